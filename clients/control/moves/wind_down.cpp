#include "clients/control/moves/wind_down.hpp"

#include <algorithm>

namespace drivebench::control {

Reference WindDown::at(double t_s) const noexcept {
  const double u_s = std::clamp(t_s - start_s_, 0.0, duration_s_);
  if (u_s >= duration_s_) return {.angle_rad = from_.angle_rad + 0.5 * from_.speed_rad_s * duration_s_};
  const double gone = u_s / duration_s_;
  return {.angle_rad = from_.angle_rad + from_.speed_rad_s * u_s * (1.0 - 0.5 * gone),
          .speed_rad_s = from_.speed_rad_s * (1.0 - gone),
          .acceleration_rad_s2 = -from_.speed_rad_s / duration_s_};
}

}  // namespace drivebench::control
