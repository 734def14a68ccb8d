#include "clients/control/moves/standard_inputs.hpp"

#include <algorithm>

#include "plant/math/exponential.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {

Reference StepMoveParameters::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  return {.angle_rad = distance_rad + speed_rad_s * std::min(t_s, duration_s),
          .speed_rad_s = t_s < duration_s ? speed_rad_s : 0.0};
}

Reference SineMoveParameters::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  const double w = angular_frequency_rad_s;
  const double angle_rad = amplitude_rad * cos_sin_unbounded(w * std::min(t_s, duration_s)).sin;
  if (t_s > duration_s) return {.angle_rad = angle_rad};
  const double speed_rad_s = amplitude_rad * w * cos_sin_unbounded(w * t_s).cos;
  return {.angle_rad = angle_rad,
          .speed_rad_s = speed_rad_s,
          .acceleration_rad_s2 = -w * w * angle_rad,
          .jerk_rad_s3 = -w * w * speed_rad_s};
}

Reference SineTorqueMoveParameters::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  const double t = std::min(t_s, duration_s);
  const double a = friction_rate_per_s;
  const double w = angular_frequency_rad_s;
  const auto [cosine, sine] = cos_sin_unbounded(w * t);
  const double decay = exponential(-a * t);
  const double decay_area_s = a > 0.0 ? -exponential_less_one(-a * t) / a : t;
  const double scale = amplitude_rad_s2 / (a * a + w * w);
  const double speed_rad_s = scale * (a * sine + w * (decay - cosine));
  const double angle_rad = scale * (a * (1.0 - cosine) / w - sine + w * decay_area_s);
  if (t_s > duration_s) return {.angle_rad = angle_rad};
  const double acceleration_rad_s2 = amplitude_rad_s2 * sine - a * speed_rad_s;
  return {.angle_rad = angle_rad,
          .speed_rad_s = speed_rad_s,
          .acceleration_rad_s2 = acceleration_rad_s2,
          .jerk_rad_s3 = amplitude_rad_s2 * w * cosine - a * acceleration_rad_s2};
}

}  // namespace drivebench::control
