#include "plant/mechanics/load.hpp"

#include <cmath>

namespace drivebench {

void LoadTorque::go_to(double target_nm, Tick tick, Tick ramp_ticks) noexcept {
  start_nm_ = at(tick);
  target_nm_ = target_nm;
  start_tick_ = tick;
  ramp_ticks_ = ramp_ticks;
}

double LoadTorque::at(Tick tick) const noexcept {
  const Tick elapsed = tick - start_tick_;
  if (elapsed < 0) return start_nm_;
  if (elapsed >= ramp_ticks_) return target_nm_;
  return start_nm_ +
         (target_nm_ - start_nm_) * (static_cast<double>(elapsed) / static_cast<double>(ramp_ticks_));
}

bool LoadTorque::is_within(double largest_nm, Tick latest) const noexcept {
  return std::abs(start_nm_) <= largest_nm && std::abs(target_nm_) <= largest_nm && start_tick_ >= 0 &&
         start_tick_ <= latest && ramp_ticks_ >= 0 && ramp_ticks_ <= latest;
}

}  // namespace drivebench
