#pragma once

#include <filesystem>
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

/// What any motor file says of its machine.
struct MotorFile {
  std::filesystem::path path;
  std::string name;
  std::string kind;
  bool star = false;  ///< three phases in a star; a brushless DC motor is one unless it says otherwise
};

/// Finds a motor by its file, or by its name in configs/motors. Throws UsageError if there is none,
/// ConfigError if it cannot be read.
MotorFile read_motor_file(const std::string& choice);

/// Reads a motor by its file, or by its name in configs/motors. Throws UsageError if there is none and if its
/// machine is of another kind, ConfigError with every wrong value.
InductionMotorFile read_induction_motor(const std::string& choice);

}  // namespace drivebench::command
