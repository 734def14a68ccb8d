#pragma once

#include "plant/tick.hpp"

namespace drivebench {

/// Load torque on the shaft: a constant, or on its way to one. Times are ticks.
class LoadTorque {
 public:
  /// Goes from the present value to target_nm in ramp_ticks (0: a step at this tick).
  void go_to(double target_nm, Tick tick, Tick ramp_ticks) noexcept;
  /// The torque that holds during this tick, which may lie before the last change.
  double at(Tick tick) const noexcept;
  /// Whether both torques are within +-largest_nm, and the ticks from 0 to `latest`: for a load from bytes.
  bool is_within(double largest_nm, Tick latest) const noexcept;

 private:
  double start_nm_ = 0.0;
  double target_nm_ = 0.0;
  Tick start_tick_ = 0;
  Tick ramp_ticks_ = 0;
};

}  // namespace drivebench
