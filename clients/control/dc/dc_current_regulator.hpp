#pragma once

#include "clients/control/gains/loop_gains.hpp"

namespace drivebench::control {

/// The current loop of an armature: v = K_P·e + K_I·∫e with e = i_ref − i, within the voltage limit; the
/// command is clamped to the current limit first. While the voltage stands at its limit the integral does not
/// move further out (the book has no such rule). Sampled it is stable for K_P·T/L < 2. Source: the book,
/// 2.2 (CUR-01).
class DcCurrentRegulator {
 public:
  DcCurrentRegulator(const CurrentGains& gains, double current_limit_a, double voltage_limit_v,
                     double period_s) noexcept
      : gains_(gains),
        current_limit_a_(current_limit_a),
        voltage_limit_v_(voltage_limit_v),
        period_s_(period_s) {}

  /// The voltage for this sample.
  double step(double wanted_a, double measured_a) noexcept;
  /// Command or voltage stood at its limit in the last step.
  bool saturated() const noexcept { return saturated_; }

 private:
  CurrentGains gains_;
  double current_limit_a_;
  double voltage_limit_v_;
  double period_s_;
  double integral_v_ = 0.0;
  bool saturated_ = false;
};

}  // namespace drivebench::control
