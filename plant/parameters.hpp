#pragma once

#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "plant/axis.hpp"
#include "plant/problem.hpp"

namespace drivebench {

/// One parameter of an axis: the configuration key, the description sent to clients, the limits and the
/// access.
struct Parameter {
  std::string_view name;  ///< section and key, for example "machine.rotor_resistance_ohm"
  std::string_view unit;
  double minimum;
  double maximum;
  bool integer;   ///< whole numbers only; a minimum of 0 and a maximum of 1 make it a switch
  bool live;      ///< may be written while the bench runs
  bool required;  ///< has no default: a configuration must name it
  std::string_view meaning;
  double (*get)(const AxisParameters&) noexcept;
  void (*set)(AxisParameters&, double) noexcept;
};

/// The table of all parameters of an axis.
std::span<const Parameter> axis_parameters() noexcept;

/// The row with this name, or null.
const Parameter* find_parameter(std::string_view name) noexcept;

/// What is wrong with writing `value` to this parameter: empty if nothing is, otherwise a sentence with value
/// and rule.
std::string problem_with(const Parameter& parameter, double value);

/// Everything that is wrong with the parameters: each value by its limits, then the rules between them.
std::vector<Problem> problems(const AxisParameters& p);

}  // namespace drivebench
