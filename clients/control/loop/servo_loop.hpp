#pragma once

#include "clients/control/gains/loop_gains.hpp"
#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// The acceleration that brings a shaft back to its trajectory:
///   α = α_ref + K0·∫e + K1·e + K2·(ω_ref − ω)        with e = θ_ref − θ
/// Source: the book, (10.14)-(10.15) (BL-04).
class ServoLoop {
 public:
  ServoLoop(const ServoGains& gains, double period_s) noexcept : gains_(gains), period_s_(period_s) {}

  double acceleration_rad_s2(const Reference& r, double angle_rad, double speed_rad_s) noexcept {
    error_rad_ = r.angle_rad - angle_rad;
    return r.acceleration_rad_s2 + gains_.integral_per_s3 * integral_rad_s_ +
           gains_.proportional_per_s2 * error_rad_ + gains_.derivative_per_s * (r.speed_rad_s - speed_rad_s);
  }
  /// To be called only while no value stands at its limit.
  void integrate() noexcept { integral_rad_s_ += period_s_ * error_rad_; }

 private:
  ServoGains gains_;
  double period_s_;
  double error_rad_ = 0.0;
  double integral_rad_s_ = 0.0;
};

}  // namespace drivebench::control
