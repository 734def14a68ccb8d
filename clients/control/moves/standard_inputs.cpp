#include "clients/control/moves/standard_inputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace drivebench::control {

std::span<const GainRow<StepMoveParameters>> StepMoveParameters::gains() noexcept {
  using P = StepMoveParameters;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"move.distance_rad", [](P& p) -> double& { return p.distance_rad; }},
      {"move.speed_rad_s", [](P& p) -> double& { return p.speed_rad_s; }},
      {"move.duration_s", [](P& p) -> double& { return p.duration_s; }, GainRule::kDuration},
  });
  return kRows;
}

Reference StepMove::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  return {.angle_rad = p_.distance_rad + p_.speed_rad_s * std::min(t_s, p_.duration_s),
          .speed_rad_s = t_s < p_.duration_s ? p_.speed_rad_s : 0.0};
}

std::span<const GainRow<SineMoveParameters>> SineMoveParameters::gains() noexcept {
  using P = SineMoveParameters;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"move.amplitude_rad", [](P& p) -> double& { return p.amplitude_rad; }},
      {"move.angular_frequency_rad_s", [](P& p) -> double& { return p.angular_frequency_rad_s; },
       GainRule::kPositive},
      {"move.duration_s", [](P& p) -> double& { return p.duration_s; }, GainRule::kDuration},
  });
  return kRows;
}

Reference SineMove::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  const double w = p_.angular_frequency_rad_s;
  const double angle_rad = p_.amplitude_rad * std::sin(w * std::min(t_s, p_.duration_s));
  if (t_s > p_.duration_s) return {.angle_rad = angle_rad};
  const double speed_rad_s = p_.amplitude_rad * w * std::cos(w * t_s);
  return {.angle_rad = angle_rad,
          .speed_rad_s = speed_rad_s,
          .acceleration_rad_s2 = -w * w * angle_rad,
          .jerk_rad_s3 = -w * w * speed_rad_s};
}

std::span<const GainRow<SineTorqueMoveParameters>> SineTorqueMoveParameters::gains() noexcept {
  using P = SineTorqueMoveParameters;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"move.amplitude_rad_s2", [](P& p) -> double& { return p.amplitude_rad_s2; }},
      {"move.angular_frequency_rad_s", [](P& p) -> double& { return p.angular_frequency_rad_s; },
       GainRule::kPositive},
      {"move.friction_rate_per_s", [](P& p) -> double& { return p.friction_rate_per_s; },
       GainRule::kNotNegative},
      {"move.duration_s", [](P& p) -> double& { return p.duration_s; }, GainRule::kDuration},
  });
  return kRows;
}

Reference SineTorqueMove::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  const double t = std::min(t_s, p_.duration_s);
  const double a = p_.friction_rate_per_s;
  const double w = p_.angular_frequency_rad_s;
  const double sine = std::sin(w * t);
  const double cosine = std::cos(w * t);
  const double decay = std::exp(-a * t);
  const double decay_area_s = a > 0.0 ? -std::expm1(-a * t) / a : t;
  const double scale = p_.amplitude_rad_s2 / (a * a + w * w);
  const double speed_rad_s = scale * (a * sine + w * (decay - cosine));
  const double angle_rad = scale * (a * (1.0 - cosine) / w - sine + w * decay_area_s);
  if (t_s > p_.duration_s) return {.angle_rad = angle_rad};
  const double acceleration_rad_s2 = p_.amplitude_rad_s2 * sine - a * speed_rad_s;
  return {.angle_rad = angle_rad,
          .speed_rad_s = speed_rad_s,
          .acceleration_rad_s2 = acceleration_rad_s2,
          .jerk_rad_s3 = p_.amplitude_rad_s2 * w * cosine - a * acceleration_rad_s2};
}

}  // namespace drivebench::control
