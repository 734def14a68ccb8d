#pragma once

#include <cstdint>

namespace drivebench {

/// Largest integer not above x, for |x| < 2^62; without the libm call that std::floor costs on plain x86-64.
constexpr std::int64_t floor_to_integer(double x) noexcept {
  const auto truncated = static_cast<std::int64_t>(x);
  return truncated - (static_cast<double>(truncated) > x ? 1 : 0);
}

}  // namespace drivebench
