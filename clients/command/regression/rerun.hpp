#pragma once

#include <string>

namespace drivebench::command {

struct RerunOptions {
  std::string program;  ///< version and build
  std::string bundle;
  bool plant_only = false;
};

/// Runs the case of a bundle again, judges it, and says whether the run is the same to the bit, or where it
/// first differs. Exit codes as run_test(); of the plant alone 0: the same, 1: another.
int run_rerun(const RerunOptions& options);

}  // namespace drivebench::command
