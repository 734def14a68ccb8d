#include "clients/control/moves/trajectory.hpp"

#include <array>
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

std::span<const GainRow<TrajectoryParameters>> TrajectoryParameters::gains() noexcept {
  using P = TrajectoryParameters;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"move.distance_rad", [](P& p) -> double& { return p.distance_rad; }},
      {"move.ramp_up_s", [](P& p) -> double& { return p.ramp_up_s; }, GainRule::kDuration},
      {"move.cruise_s", [](P& p) -> double& { return p.cruise_s; }, GainRule::kPause},
      {"move.ramp_down_s", [](P& p) -> double& { return p.ramp_down_s; }, GainRule::kDuration},
  });
  return kRows;
}

std::vector<std::string> TrajectoryParameters::problems() const {
  return range_problems(*this);
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
