#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Section [axis.current_loop]: P or PI with anti-windup, run at every substep (at most 20 us). The loop is
/// sampled: it is stable for proportional_v_per_a below the inductance over the substep.
struct CurrentLoopParameters {
  double proportional_v_per_a = 0.0;
  double integral_v_per_as = 0.0;
  double limit_a = 0.0;  ///< of the command, per phase
};

/// The commanded currents within their limit. In a star the common part, which cannot flow, is taken away:
/// otherwise the integrals would grow with it.
PhaseValues limited_currents(const CurrentLoopParameters& p, const PhaseValues& command_a,
                             Connection connection) noexcept;

/// The voltage that the loop of a phase asks for: v = K_P e + integral. Source: the book, section 2.2;
/// tag CUR-01.
constexpr double loop_voltage_v(const CurrentLoopParameters& p, double error_a, double integral_v) noexcept {
  return p.proportional_v_per_a * error_a + integral_v;
}

/// The integral after an interval: integral' = K_I e with the mean error. It stands still while the wanted
/// voltage is beyond the limit and the error drives it further out.
constexpr double integral_after(const CurrentLoopParameters& p, double integral_v, double wanted_v,
                                double limit_v, double mean_error_a, double duration_s) noexcept {
  const bool outward =
      (wanted_v > limit_v && mean_error_a > 0.0) || (wanted_v < -limit_v && mean_error_a < 0.0);
  return outward ? integral_v : integral_v + p.integral_v_per_as * mean_error_a * duration_s;
}

}  // namespace drivebench
