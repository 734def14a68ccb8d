#pragma once

#include <string>

namespace drivebench::command {

struct FmuOptions {
  std::string bench = "servo";  ///< a bench file, or its name
  std::string out_file{};       ///< empty: NAME.fmu here
  int fmi = 2;                  ///< version of the standard: 2 or 3
  bool json = false;
};

/// Writes a bench as a Functional Mock-up Unit for co-simulation.
int run_fmu(const FmuOptions& options);

}  // namespace drivebench::command
