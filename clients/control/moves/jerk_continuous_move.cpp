#include "clients/control/moves/jerk_continuous_move.hpp"

#include <algorithm>
#include <array>

namespace drivebench::control {
namespace {

/// The ramp from rest: at u after its start, with the angle covered since then.
Reference smooth_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept {
  const double x = u_s / ramp_s;
  const double acceleration = max_speed_rad_s / ramp_s;
  return {.angle_rad = max_speed_rad_s * ramp_s * x * x * x * x * (2.5 - 3.0 * x + x * x),
          .speed_rad_s = max_speed_rad_s * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x),
          .acceleration_rad_s2 = acceleration * 30.0 * x * x * (1.0 - x) * (1.0 - x),
          .jerk_rad_s3 = acceleration / ramp_s * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)};
}

}  // namespace

Reference JerkContinuousMove::at(double t_s) const noexcept {
  const double max_speed_rad_s = p_.max_speed_rad_s();
  if (t_s < 0.0) return {};
  if (t_s < p_.ramp_up_s) return smooth_ramp(max_speed_rad_s, p_.ramp_up_s, t_s);
  if (t_s < p_.ramp_up_s + p_.cruise_s) {
    return {.angle_rad = max_speed_rad_s * (t_s - 0.5 * p_.ramp_up_s), .speed_rad_s = max_speed_rad_s};
  }
  const double left_s = p_.duration_s() - t_s;
  if (left_s <= 0.0) return {.angle_rad = p_.distance_rad};
  // Backwards in time angle and acceleration change sign, speed and jerk do not.
  const Reference mirrored = smooth_ramp(max_speed_rad_s, p_.ramp_down_s, left_s);
  return {.angle_rad = p_.distance_rad - mirrored.angle_rad,
          .speed_rad_s = mirrored.speed_rad_s,
          .acceleration_rad_s2 = -mirrored.acceleration_rad_s2,
          .jerk_rad_s3 = mirrored.jerk_rad_s3};
}

std::span<const GainRow<SpeedRampParameters>> SpeedRampParameters::gains() noexcept {
  using P = SpeedRampParameters;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"move.speed_rad_s", [](P& p) -> double& { return p.speed_rad_s; }},
      {"move.ramp_s", [](P& p) -> double& { return p.ramp_s; }, GainRule::kDuration},
      {"move.cruise_s", [](P& p) -> double& { return p.cruise_s; }, GainRule::kPause},
  });
  return kRows;
}

Reference SpeedRamp::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  if (t_s < p_.ramp_s) return smooth_ramp(p_.speed_rad_s, p_.ramp_s, t_s);
  return {.angle_rad = p_.speed_rad_s * (std::min(t_s, duration_s()) - 0.5 * p_.ramp_s),
          .speed_rad_s = p_.speed_rad_s};
}

}  // namespace drivebench::control
