#pragma once

#include <cstdint>

#include "plant/math/rounding.hpp"

namespace drivebench {

/// An analog sensor with its anti-alias filter and converter, the same for every channel of the bench.
struct AnalogParameters {
  bool enabled = false;
  int bits = 0;             ///< resolution of the converter; 0: ideal, neither quantised nor limited
  double full_scale = 1.0;  ///< the converter spans -full_scale to +full_scale less one step
  double gain = 1.0;
  double offset = 0.0;
  double noise_rms = 0.0;    ///< Gaussian, white from tick to tick
  double delay_ticks = 0.0;  ///< 0, 0.5 or a whole number up to 8: how old the sample is
  double filter_hz = 0.0;    ///< first-order low-pass before the converter; 0: none
};

inline constexpr int kMaxSensorDelayTicks = 8;

/// Whether a channel can be this late: 0, 0.5, 1, 2, ... kMaxSensorDelayTicks.
constexpr bool is_sensor_delay(double ticks) noexcept {
  if (!(ticks >= 0.0 && ticks <= kMaxSensorDelayTicks)) return false;
  return ticks == 0.5 || ticks == static_cast<double>(static_cast<int>(ticks));
}

/// The reading of a channel, and whether its converter was at its end.
struct AnalogReading {
  double value = 0.0;
  bool saturated = false;
  std::int64_t steps = 0;  ///< of the converter, from zero; 0 of an ideal one
};

/// The number of a converter of so many bits: 0 to 2^bits - 1, half way for a reading of 0.
constexpr std::uint64_t converter_count(const AnalogReading& reading, int bits) noexcept {
  return bits > 0 ? static_cast<std::uint64_t>(reading.steps + (std::int64_t{1} << (bits - 1))) : 0;
}

/// The converter: the nearest of 2^bits steps, limited to the range; a tie goes up. 0 bits: as it is.
constexpr AnalogReading converted(double analog, int bits, double full_scale) noexcept {
  if (bits == 0) return {.value = analog};
  const std::int64_t side = std::int64_t{1} << (bits - 1);
  const double steps_per_side = static_cast<double>(side);
  const double step = full_scale / steps_per_side;
  const double steps = analog / step + 0.5;
  if (steps >= steps_per_side)
    return {.value = (steps_per_side - 1.0) * step, .saturated = true, .steps = side - 1};
  if (steps < -steps_per_side) return {.value = -full_scale, .saturated = true, .steps = -side};
  const std::int64_t whole = floor_to_integer(steps);
  return {.value = static_cast<double>(whole) * step, .saturated = false, .steps = whole};
}

}  // namespace drivebench
