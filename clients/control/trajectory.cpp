#include "clients/control/trajectory.hpp"

#include <cmath>

namespace drivebench::control {
namespace {

/// The ramp from rest: at u after its start, with the angle covered since then.
Reference cubic_ramp(double max_speed_rad_s, double ramp_s, double u_s) noexcept {
  const double c1 = 3.0 * max_speed_rad_s / (ramp_s * ramp_s);
  const double c2 = -2.0 * max_speed_rad_s / (ramp_s * ramp_s * ramp_s);
  return {.angle_rad = u_s * u_s * u_s * (c1 / 3.0 + c2 * u_s / 4.0),
          .speed_rad_s = u_s * u_s * (c1 + c2 * u_s),
          .acceleration_rad_s2 = u_s * (2.0 * c1 + 3.0 * c2 * u_s),
          .jerk_rad_s3 = 2.0 * c1 + 6.0 * c2 * u_s};
}

}  // namespace

std::vector<std::string> TrajectoryParameters::problems() const {
  std::vector<std::string> found;
  if (!std::isfinite(distance_rad)) found.emplace_back("distance_rad must be finite");
  // Written so that NaN fails too.
  if (!(ramp_up_s > 0.0) || std::isinf(ramp_up_s))
    found.emplace_back("ramp_up_s must be positive and finite");
  if (!(cruise_s >= 0.0) || std::isinf(cruise_s)) {
    found.emplace_back("cruise_s must not be negative and must be finite");
  }
  if (!(ramp_down_s > 0.0) || std::isinf(ramp_down_s)) {
    found.emplace_back("ramp_down_s must be positive and finite");
  }
  return found;
}

double TrajectoryParameters::max_speed_rad_s() const noexcept {
  return distance_rad / (0.5 * ramp_up_s + cruise_s + 0.5 * ramp_down_s);
}

double TrajectoryParameters::duration_s() const noexcept {
  return ramp_up_s + cruise_s + ramp_down_s;
}

Reference trajectory_at(const TrajectoryParameters& p, double t_s) noexcept {
  const double max_speed_rad_s = p.max_speed_rad_s();
  if (t_s < 0.0) return {};
  if (t_s < p.ramp_up_s) return cubic_ramp(max_speed_rad_s, p.ramp_up_s, t_s);
  if (t_s < p.ramp_up_s + p.cruise_s) {
    return {.angle_rad = max_speed_rad_s * (t_s - 0.5 * p.ramp_up_s), .speed_rad_s = max_speed_rad_s};
  }
  const double left_s = p.duration_s() - t_s;
  if (left_s <= 0.0) return {.angle_rad = p.distance_rad};
  // Braking is the ramp run backwards in time: angle and acceleration change sign, speed and jerk do not.
  const Reference mirrored = cubic_ramp(max_speed_rad_s, p.ramp_down_s, left_s);
  return {.angle_rad = p.distance_rad - mirrored.angle_rad,
          .speed_rad_s = mirrored.speed_rad_s,
          .acceleration_rad_s2 = -mirrored.acceleration_rad_s2,
          .jerk_rad_s3 = mirrored.jerk_rad_s3};
}

}  // namespace drivebench::control
