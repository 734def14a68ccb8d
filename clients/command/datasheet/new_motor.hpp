#pragma once

#include <string>

#include "clients/command/datasheet/motor_kind.hpp"

namespace drivebench::command {

struct NewMotorOptions {
  Sheet sheet{};
  std::string name{};
  std::string source = "data sheet";
  std::string out_file{};  ///< empty: standard output
};

/// Writes a motor file from the numbers of a data sheet. Asks on a terminal for what is missing; throws
/// UsageError with all of it elsewhere, and with both numbers where two contradict each other.
int run_new_motor(const MotorKind& kind, const NewMotorOptions& options);

}  // namespace drivebench::command
