#include "clients/control/loop/current_loop.hpp"

#include <algorithm>

namespace drivebench::control {

PhaseVoltages CurrentLoop::step(Dq error_a, CosSin flux) noexcept {
  const TwoPhase wanted_v = to_ab({.d = gains_.proportional_v_per_a * error_a.d + integral_v_.d,
                                   .q = gains_.proportional_v_per_a * error_a.q + integral_v_.q},
                                  flux);
  const TwoPhase given_v = {.a = std::clamp(wanted_v.a, -voltage_limit_v_, voltage_limit_v_),
                            .b = std::clamp(wanted_v.b, -voltage_limit_v_, voltage_limit_v_)};
  const bool saturated = given_v.a != wanted_v.a || given_v.b != wanted_v.b;
  if (!saturated) {
    integral_v_.d += gains_.integral_v_per_as * period_s_ * error_a.d;
    integral_v_.q += gains_.integral_v_per_as * period_s_ * error_a.q;
  }
  return {.voltage_v = given_v, .saturated = saturated};
}

}  // namespace drivebench::control
