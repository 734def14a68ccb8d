#include "plant/mechanics.hpp"

#include <cmath>

namespace drivebench {

FrictionBranch friction_branch(const ShaftParameters& p, double speed_rad_s, double driving_nm) noexcept {
  if (speed_rad_s > 0.0) return {.turns = 1.0, .direction = 1.0};
  if (speed_rad_s < 0.0) return {.turns = 1.0, .direction = -1.0};
  if (std::abs(driving_nm) <= p.static_friction_nm) return {.turns = 0.0, .direction = 0.0};
  return {.turns = 1.0, .direction = driving_nm > 0.0 ? 1.0 : -1.0};
}

void LoadTorque::go_to(double target_nm, Tick tick, Tick ramp_ticks) noexcept {
  start_nm_ = at(tick);
  target_nm_ = target_nm;
  start_tick_ = tick;
  ramp_ticks_ = ramp_ticks;
}

double LoadTorque::at(Tick tick) const noexcept {
  const Tick elapsed = tick - start_tick_;
  if (elapsed >= ramp_ticks_) return target_nm_;
  return start_nm_ +
         (target_nm_ - start_nm_) * (static_cast<double>(elapsed) / static_cast<double>(ramp_ticks_));
}

}  // namespace drivebench
