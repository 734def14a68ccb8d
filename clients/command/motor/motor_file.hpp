#pragma once

#include <string>
#include <vector>

#include "clients/models/induction_machine.hpp"

namespace drivebench::command {

/// An induction motor of configs/motors.
struct InductionMotorFile {
  std::string name;
  InductionMotorModel motor;
  bool star = false;
  std::vector<std::string> left_out{};  ///< keys of [mechanics] that are not in the model
};

/// Reads a motor by its file, or by its name in configs/motors. Throws UsageError if there is none and if its
/// machine is of another kind, ConfigError with every wrong value.
InductionMotorFile read_induction_motor(const std::string& choice);

}  // namespace drivebench::command
