#pragma once

#include "clients/control/gains/loop_gains.hpp"
#include "plant/math/frames.hpp"
#include "plant/math/length.hpp"

namespace drivebench::control {

/// PI control of i_d and i_q around a feed-forward, limited as a vector:
///   u = u_ff + K_P·e + K_I·∫e,   shortened to |u| ≤ V
/// While the vector is shortened the integrals stand still.
class VectorCurrentLoop {
 public:
  VectorCurrentLoop(const CurrentGains& gains, double voltage_limit_v, double period_s) noexcept
      : gains_(gains), voltage_limit_v_(voltage_limit_v), period_s_(period_s) {}

  Dq voltage_v(Dq error_a, Dq feed_forward_v) noexcept {
    const Dq wanted{.d = feed_forward_v.d + gains_.proportional_v_per_a * error_a.d + integral_v_.d,
                    .q = feed_forward_v.q + gains_.proportional_v_per_a * error_a.q + integral_v_.q};
    const double length_v = length(wanted.d, wanted.q);
    saturated_ = length_v > voltage_limit_v_;
    if (saturated_) {
      const double share = voltage_limit_v_ / length_v;
      return {.d = share * wanted.d, .q = share * wanted.q};
    }
    integral_v_.d += gains_.integral_v_per_as * period_s_ * error_a.d;
    integral_v_.q += gains_.integral_v_per_as * period_s_ * error_a.q;
    return wanted;
  }

  bool saturated() const noexcept { return saturated_; }  ///< in the last sample

 private:
  CurrentGains gains_;
  double voltage_limit_v_;
  double period_s_;
  Dq integral_v_{.d = 0.0, .q = 0.0};
  bool saturated_ = false;
};

}  // namespace drivebench::control
