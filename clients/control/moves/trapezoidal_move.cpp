#include "clients/control/moves/trapezoidal_move.hpp"

namespace drivebench::control {

Reference TrapezoidalMove::at(double t_s) const noexcept {
  const double max_speed_rad_s = p_.max_speed_rad_s();
  if (t_s < 0.0) return {};
  if (t_s < p_.ramp_up_s) {
    const double acceleration_rad_s2 = max_speed_rad_s / p_.ramp_up_s;
    return {.angle_rad = 0.5 * acceleration_rad_s2 * t_s * t_s,
            .speed_rad_s = acceleration_rad_s2 * t_s,
            .acceleration_rad_s2 = acceleration_rad_s2};
  }
  if (t_s < p_.ramp_up_s + p_.cruise_s) {
    return {.angle_rad = max_speed_rad_s * (t_s - 0.5 * p_.ramp_up_s), .speed_rad_s = max_speed_rad_s};
  }
  const double left_s = p_.duration_s() - t_s;
  if (left_s <= 0.0) return {.angle_rad = p_.distance_rad};
  const double braking_rad_s2 = max_speed_rad_s / p_.ramp_down_s;
  return {.angle_rad = p_.distance_rad - 0.5 * braking_rad_s2 * left_s * left_s,
          .speed_rad_s = braking_rad_s2 * left_s,
          .acceleration_rad_s2 = -braking_rad_s2};
}

}  // namespace drivebench::control
