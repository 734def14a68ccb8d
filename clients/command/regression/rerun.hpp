#pragma once

#include <string>

namespace drivebench::command {

struct RerunOptions {
  std::string program;  ///< version and build
  std::string bundle;
  bool plant_only = false;
  std::string from{};        ///< where the device under test begins: a tick, or a time as `0.03s`; empty: 0
  bool interactive = false;  ///< serves the bench there, or at the failure, in the place of a run
  unsigned port = 0;         ///< of that bench; 0: chosen by the system
};

/// Runs the case of a bundle again, judges it, and says whether the run is the same to the bit, or where it
/// first differs. Exit codes as run_test(); of the plant alone 0: the same, 1: another.
///
/// With `from` the recorded run is repeated to the bit up to that tick. A preset has seen it then and goes
/// on; a program is started there, and its samples are not compared.
int run_rerun(const RerunOptions& options);

}  // namespace drivebench::command
