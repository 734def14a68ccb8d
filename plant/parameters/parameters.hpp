#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "plant/axis_parameters.hpp"
#include "plant/problem.hpp"

namespace drivebench {

/// The range in which the values of nearly every machine lie. The ranges are wide, from motors for models to
/// those of mills and ships: a value outside is allowed, and more likely in the wrong unit (mH for H, rpm for
/// rad/s) than meant.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

/// One number of an axis: the configuration key, the description sent to clients, the limits and the access.
struct Parameter {
  std::string_view name;  ///< section and key, for example "machine.rotor_resistance_ohm"
  std::string_view unit;
  double minimum;
  double maximum;
  bool integer;   ///< whole numbers only; a minimum of 0 and a maximum of 1 make it a switch
  bool live;      ///< may be written while the bench runs
  bool required;  ///< has no default: a configuration must name it
  bool later;     ///< added to the table when runs had been recorded: hashes pass over it while it is 0
  std::string_view meaning;
  double (*get)(const AxisParameters&) noexcept;
  void (*set)(AxisParameters&, double) noexcept;
  /// A choice: the word for each value from 0 on, as configurations write it; empty for numbers and switches.
  std::span<const std::string_view> words{};
  Range usual{};
};

/// One curve of an axis, which configurations give as points [[x, y], ...] or as the name of a CSV file.
struct CurveParameter {
  std::string_view name;
  std::string_view x_unit;
  std::string_view y_unit;
  bool required;
  bool rising;  ///< y must rise with x
  std::string_view meaning;
  const Curve& (*get)(const AxisParameters&) noexcept;
  void (*set)(AxisParameters&, Curve);
};

inline constexpr std::size_t kMaxCurvePoints = 100'000;

/// The kinds of machine by their words, in the order of MachineParameters.
std::span<const std::string_view> machine_kinds() noexcept;
std::string_view machine_kind(const AxisParameters& p) noexcept;
/// A machine of the kind with every parameter at its default.
MachineParameters make_machine(std::size_t kind);

/// The table of all parameters of an axis with this kind of machine.
std::span<const Parameter> axis_parameters(const AxisParameters& p) noexcept;
std::span<const CurveParameter> axis_curves(const AxisParameters& p) noexcept;

/// The row with this name, or null.
const Parameter* find_parameter(const AxisParameters& p, std::string_view name) noexcept;

/// The problem of writing `value` to this parameter, as a sentence with value and rule; empty: none.
std::string problem_with(const Parameter& parameter, double value);

/// Everything that is wrong with the parameters: each value by its limits, the points of the curves, then the
/// rules between the values.
std::vector<Problem> problems(const AxisParameters& p);

/// The same questions with yes or no for an answer, for the tick: no text, no allocation.
/// Whether problem_with() has something to say.
bool breaks_a_rule(const Parameter& parameter, double value) noexcept;
/// Whether a rule between values is broken. Each value has been asked for before, and curves cannot change
/// while the bench runs: they are not looked at again.
bool breaks_a_rule(const AxisParameters& p) noexcept;

}  // namespace drivebench
