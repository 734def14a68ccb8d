#pragma once

#include <optional>
#include <string>

namespace drivebench::command {

struct NewCaseOptions {
  std::string bench{};    ///< a bench file, or its name in configs/benches
  std::string command{};  ///< of the device under test, its words separated by blanks
  double speed_rad_s = 0.0;
  std::optional<double> load_nm{};
  double duration_s = 1.0;
  std::string out_file{};  ///< empty: standard output
};

/// Writes a regression case for a program that brings the motor of a bench to a speed and holds it there,
/// and, unless it goes to standard output, has `drivebench test --list` check it.
int run_new_case(const NewCaseOptions& options);

}  // namespace drivebench::command
