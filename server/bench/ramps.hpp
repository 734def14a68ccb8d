#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "plant/tick.hpp"

namespace drivebench {

inline constexpr std::size_t kMaxRamps = 16;  ///< of an axis at a time

/// A linear ramp of a parameter.
struct ParameterRamp {
  std::uint64_t row = 0;  ///< of axis_parameters() of the axis
  double from = 0.0;
  double to = 0.0;
  Tick start = 0;
  Tick ticks = 0;

  /// The value in force during a tick.
  double at(Tick tick) const noexcept {
    const Tick elapsed = tick - start;
    if (elapsed >= ticks) return to;
    return from + (to - from) * (static_cast<double>(elapsed) / static_cast<double>(ticks));
  }
  bool is_over(Tick tick) const noexcept { return tick - start >= ticks; }
};

/// The running ramps of an axis, oldest first. 8-byte members only; unused entries are zero.
struct ParameterRamps {
  std::uint64_t count = 0;
  std::array<ParameterRamp, kMaxRamps> ramp{};

  bool has(std::uint64_t row) const noexcept {
    return std::any_of(ramp.begin(), end(), [row](const ParameterRamp& r) { return r.row == row; });
  }
  /// Returns false if all kMaxRamps entries are in use.
  bool add(const ParameterRamp& added) noexcept {
    if (count == kMaxRamps) return false;
    ramp[count++] = added;
    return true;
  }
  void remove(std::size_t index) noexcept {
    std::move(ramp.begin() + static_cast<std::ptrdiff_t>(index) + 1, ramp.begin() + size(),
              ramp.begin() + static_cast<std::ptrdiff_t>(index));
    ramp[--count] = {};
  }
  void forget(std::uint64_t row) noexcept {
    for (std::size_t i = count; i-- > 0;) {
      if (ramp[i].row == row) remove(i);
    }
  }

 private:
  std::ptrdiff_t size() const noexcept { return static_cast<std::ptrdiff_t>(count); }
  std::array<ParameterRamp, kMaxRamps>::const_iterator end() const noexcept { return ramp.begin() + size(); }
};

}  // namespace drivebench
