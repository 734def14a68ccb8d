#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "plant/axis_parameters.hpp"
#include "protocols/refusals.hpp"
#include "server/bench/input.hpp"

/// What clients may ask to change, judged before it becomes an input: one set of rules and sentences for
/// every way to the bench.
namespace drivebench {

/// A request that cannot become an input.
struct RefusedRequest {
  TcpRefusal code;
  std::string sentence;    ///< the value and the rule
  std::string_view field;  ///< of the request, as bench.proto names it
};

/// A request as the action of an input, or the reason why it is none.
using JudgedRequest = std::variant<Action, RefusedRequest>;

/// An axis as a request for a change sees it.
struct ChangeView {
  const AxisParameters& parameters;  ///< in force
  std::string_view shaft_of;         ///< the name of the axis whose shaft this one shares; empty: its own
  std::string_view amplifier_of;     ///< the name of the axis whose amplifier this one shares; empty: its own
  bool drives_another;               ///< another axis shares the amplifier of this one
  Tick tick;                         ///< the current one
};

/// The reason why a parameter cannot have this value, whatever the values of the others; empty: it can.
std::string problem_with_value(const ChangeView& axis, std::uint32_t row, double value);
/// The reason why a parameter cannot have this value now; empty: it can.
std::string problem_with_write(const ChangeView& axis, std::uint32_t row, double value);

/// The sentences about names that are not there, with the nearest one that is.
std::string unknown_parameter(const AxisParameters& parameters, std::string_view name);
std::string unknown_fault(std::string_view name);

/// A parameter: at once (`at_tick` not above the current tick) it is checked against all rules, for a later
/// tick against its own limits.
JudgedRequest judge_parameter(const ChangeView& axis, std::string_view name, double value,
                              std::uint64_t ramp_ticks, std::uint64_t at_tick);
JudgedRequest judge_load(double load_nm, std::uint64_t ramp_ticks, std::uint64_t at_tick);
JudgedRequest judge_fault(std::string_view name, double value, std::uint64_t at_tick);
JudgedRequest judge_bump(double impulse_nms, std::uint64_t at_tick);

}  // namespace drivebench
