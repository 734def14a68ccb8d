#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {
Reference cubic_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept {
  const double c1 = 3.0 * max_speed_rad_s / (ramp_s * ramp_s);
  const double c2 = -2.0 * max_speed_rad_s / (ramp_s * ramp_s * ramp_s);
  return {.angle_rad = u_s * u_s * u_s * (c1 / 3.0 + c2 * u_s / 4.0),
          .speed_rad_s = u_s * u_s * (c1 + c2 * u_s),
          .acceleration_rad_s2 = u_s * (2.0 * c1 + 3.0 * c2 * u_s),
          .jerk_rad_s3 = 2.0 * c1 + 6.0 * c2 * u_s};
}

Reference smooth_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept {
  const double x = u_s / ramp_s;
  const double acceleration = max_speed_rad_s / ramp_s;
  return {.angle_rad = max_speed_rad_s * ramp_s * x * x * x * x * (2.5 - 3.0 * x + x * x),
          .speed_rad_s = max_speed_rad_s * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x),
          .acceleration_rad_s2 = acceleration * 30.0 * x * x * (1.0 - x) * (1.0 - x),
          .jerk_rad_s3 = acceleration / ramp_s * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)};
}

Reference linear_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept {
  const double acceleration_rad_s2 = max_speed_rad_s / ramp_s;
  return {.angle_rad = 0.5 * acceleration_rad_s2 * u_s * u_s,
          .speed_rad_s = acceleration_rad_s2 * u_s,
          .acceleration_rad_s2 = acceleration_rad_s2};
}

double TrajectoryParameters::max_speed_rad_s() const noexcept {
  return distance_rad / (0.5 * ramp_up_s + cruise_s + 0.5 * ramp_down_s);
}

double TrajectoryParameters::duration_s() const noexcept {
  return ramp_up_s + cruise_s + ramp_down_s;
}

Reference ramped_at(const TrajectoryParameters& p, double t_s, Ramp ramp) noexcept {
  const double max_speed_rad_s = p.max_speed_rad_s();
  if (t_s < 0.0) return {};
  if (t_s < p.ramp_up_s) return ramp(max_speed_rad_s, p.ramp_up_s, t_s);
  if (t_s < p.ramp_up_s + p.cruise_s) {
    return {.angle_rad = max_speed_rad_s * (t_s - 0.5 * p.ramp_up_s), .speed_rad_s = max_speed_rad_s};
  }
  const double left_s = p.duration_s() - t_s;
  if (left_s <= 0.0) return {.angle_rad = p.distance_rad};
  // Braking is the ramp run backwards in time: angle and acceleration change sign, speed and jerk do not.
  const Reference mirrored = ramp(max_speed_rad_s, p.ramp_down_s, left_s);
  return {.angle_rad = p.distance_rad - mirrored.angle_rad,
          .speed_rad_s = mirrored.speed_rad_s,
          .acceleration_rad_s2 = -mirrored.acceleration_rad_s2,
          .jerk_rad_s3 = mirrored.jerk_rad_s3};
}

}  // namespace drivebench::control
