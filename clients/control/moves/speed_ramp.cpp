#include "clients/control/moves/speed_ramp.hpp"

#include <algorithm>

namespace drivebench::control {
Reference SpeedRampParameters::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  if (t_s < ramp_s) return smooth_ramp(speed_rad_s, ramp_s, t_s);
  return {.angle_rad = speed_rad_s * (std::min(t_s, duration_s()) - 0.5 * ramp_s),
          .speed_rad_s = speed_rad_s};
}

}  // namespace drivebench::control
