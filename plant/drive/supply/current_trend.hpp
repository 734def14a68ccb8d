#pragma once

namespace drivebench {

/// The way of a terminal current, for what the drive integrates from it. The current of the next interval is
/// the parabola through the ends of the last two, which makes charge and flux third-order accurate; after a
/// jump of the voltage it starts as a constant. 8-byte members only.
struct CurrentTrend {
  double slope_a_s = 0.0;   ///< over the last interval
  double bend_a_s2 = 0.0;   ///< second divided difference
  double interval_s = 0.0;  ///< the last one; 0: none yet
};

/// The current a time after the start of an interval, at which it is current_a.
constexpr double foreseen_a(const CurrentTrend& x, double current_a, double time_s) noexcept {
  return current_a + time_s * (x.slope_a_s + x.bend_a_s2 * (time_s + x.interval_s));
}

/// The trend after an interval with these currents at its ends. An interval of rounding size gives no slope.
constexpr CurrentTrend followed(const CurrentTrend& x, double from_a, double to_a,
                                double duration_s) noexcept {
  constexpr double kTooShort = 1e-3;  // of the last interval
  if (duration_s < kTooShort * x.interval_s) return x;
  const double slope_a_s = (to_a - from_a) / duration_s;
  return {.slope_a_s = slope_a_s,
          .bend_a_s2 = x.interval_s > 0.0 ? (slope_a_s - x.slope_a_s) / (duration_s + x.interval_s) : 0.0,
          .interval_s = duration_s};
}

}  // namespace drivebench
