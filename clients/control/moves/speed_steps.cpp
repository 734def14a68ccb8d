#include "clients/control/moves/speed_steps.hpp"

namespace drivebench::control {

Reference SpeedStepsParameters::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  if (t_s < first_s) return {.angle_rad = first_rad_s * t_s, .speed_rad_s = first_rad_s};
  return {.angle_rad = first_rad_s * first_s + second_rad_s * (t_s - first_s), .speed_rad_s = second_rad_s};
}

}  // namespace drivebench::control
