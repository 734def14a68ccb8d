#pragma once

#include <fmt/core.h>

#include <string>

namespace drivebench {

/// A measured or calculated value, as every table and report prints it: five significant digits, so that a
/// current of some milliamperes is as readable as one of some hundred amperes.
inline std::string number_text(double value) {
  return fmt::format("{:.5g}", value);
}

}  // namespace drivebench
