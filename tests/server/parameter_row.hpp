#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "plant/parameters/parameters.hpp"
#include "server/bench/input.hpp"

namespace drivebench {

/// The position of a parameter in the table of an axis.
inline std::uint32_t row_of(const AxisParameters& p, std::string_view name) {
  const Parameter* const row = find_parameter(p, name);
  if (row == nullptr) throw std::invalid_argument("no parameter " + std::string(name));
  return static_cast<std::uint32_t>(row - axis_parameters(p).data());
}

inline double value_of(const AxisParameters& p, std::string_view name) {
  return axis_parameters(p)[row_of(p, name)].get(p);
}

inline ParameterWrite write_of(const AxisParameters& p, std::string_view name, double value,
                               Tick ramp_ticks = 0) {
  return {.row = row_of(p, name), .value = value, .ramp_ticks = ramp_ticks};
}

inline InjectFault fault_of(std::string_view name, double value) {
  return {.row = static_cast<std::uint32_t>(find_injectable_fault(name)), .value = value};
}

}  // namespace drivebench
