#pragma once

#include "clients/control/gains/loop_gains.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

struct PhaseVoltages {
  TwoPhase voltage_v;
  bool saturated;  ///< at least one phase stands at its limit
};

/// PI control of i_d and i_q straight to voltages, without decoupling: u = K_P·e + K_I·∫e on each axis,
/// turned into the phases and limited there, as the amplifier would. While a phase is limited both
/// integrators stand still, so they never hold more than what the amplifier could give. Source: the book,
/// (8.12) (IMC-02).
class CurrentLoop {
 public:
  CurrentLoop(const CurrentGains& gains, double voltage_limit_v, double period_s) noexcept
      : gains_(gains), voltage_limit_v_(voltage_limit_v), period_s_(period_s) {}

  PhaseVoltages step(Dq error_a, CosSin flux) noexcept;

  Dq integral_v() const noexcept { return integral_v_; }

 private:
  CurrentGains gains_;
  double voltage_limit_v_;
  double period_s_;
  Dq integral_v_{.d = 0.0, .q = 0.0};
};

}  // namespace drivebench::control
