#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/datasheet/sheet.hpp"

namespace drivebench::command {

/// What a data sheet is asked for about one kind of motor, and the file that comes of it. A new kind is one
/// of these and its row in motor_kinds().
struct MotorKind {
  std::string_view name;     ///< of the verb
  std::string_view machine;  ///< machine.kind of the file
  std::string_view title;
  std::string_view example;  ///< options of a motor that exists
  bool phases;               ///< three of them, which may be in a delta
  std::span<const Quantity> machine_values;
  std::span<const Quantity> shaft_values;
  std::span<const Quantity> other_values;  ///< in no line of their own
  /// What is missing beside the required quantities.
  std::vector<Quantity> (*missing)(const Sheet& sheet);
  /// The lines of [machine] that need several quantities.
  std::vector<FileLine> (*more_lines)(Sheet& sheet);
  /// Throws UsageError if the numbers contradict each other; returns remarks.
  std::vector<std::string> (*check)(const Sheet& sheet);
};

extern const MotorKind kDcMotor;
extern const MotorKind kPmMotor;
extern const MotorKind kBldcMotor;
extern const MotorKind kInductionMotor;

inline constexpr std::array kMotorKinds = {&kDcMotor, &kPmMotor, &kBldcMotor, &kInductionMotor};

inline std::vector<Quantity> nothing_more(const Sheet&) {
  return {};
}
inline std::vector<FileLine> no_more_lines(Sheet&) {
  return {};
}

/// A motor with magnets as a rated and a no-load point of a data sheet show it.
struct MagnetMotor {
  double nm_per_a;      ///< torque over current, both as the data sheet prints them
  double v_s_per_rad;   ///< voltage over speed
  double ohm;           ///< with which the no-load current lowers that voltage
  const char* current;  ///< what current and voltage are, for messages
  const char* voltage;
};
/// Compares rated torque with rated current and the no-load speed with its voltage.
std::vector<std::string> check_magnet_motor(const Sheet& sheet, const MagnetMotor& motor);

}  // namespace drivebench::command
