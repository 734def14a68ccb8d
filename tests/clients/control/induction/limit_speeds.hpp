#pragma once

#include <algorithm>
#include <cmath>

#include "clients/control/induction/optimum_torque_induction.hpp"

// The closed forms that the book has for the speeds at which the limits of an induction machine change; the
// product tries the limits instead.
namespace drivebench::control {

/// Up to this speed the current alone limits the torque: the positive root of
///   0 = T_S²n_p²(1+σ²)ω² + 2T_S·δ1·n_p(1 − σ + r(1+σ²))ω + 2 + 2(1−σ)r + r²(1+σ²) − 2k²     δ1 = ±1
/// and 0 when there is none. Source: (8.85) (IMT-05).
inline double base_speed_rad_s(const SteadyInductionModel& m, const VectorLimits& limits,
                               TorqueSign sign) noexcept {
  const double r = m.stator_time_s / m.rotor_time_s;
  const double k = limits.voltage_v / (m.stator_resistance_ohm * limits.current_a);
  const double one_and_s2 = 1.0 + m.leakage * m.leakage;
  const double electrical_s = m.stator_time_s * m.pole_pairs;
  const double square = electrical_s * electrical_s * one_and_s2;
  const double half =
      electrical_s * (sign == TorqueSign::kMotoring ? 1.0 : -1.0) * (1.0 - m.leakage + r * one_and_s2);
  const double constant = 2.0 + 2.0 * (1.0 - m.leakage) * r + r * r * one_and_s2 - 2.0 * k * k;
  const double under_root = half * half - square * constant;
  return under_root < 0.0 ? 0.0 : std::max(0.0, (-half + std::sqrt(under_root)) / square);
}

/// From this speed on the voltage alone limits the motoring torque: there the current at the voltage's own
/// optimum has come down to the limit.
inline double voltage_limited_speed_rad_s(const SteadyInductionModel& m, const VectorLimits& limits) {
  const auto above_current_limit = [&](double speed_rad_s) {
    const double delta = voltage_extrema(m, speed_rad_s).back();
    return limits.voltage_v * m.current_a_per_direct(delta) >
           limits.current_a * m.voltage_v_per_direct(delta, speed_rad_s);
  };
  double low = 0.0;
  double high = 1.0;
  while (above_current_limit(high))
    high *= 2.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (above_current_limit(middle) ? low : high) = middle;
  }
  return high;
}

/// The speed at which the voltage comes to its limit at rated flux, as the book has it for L_S = L_R = M:
/// n_p·ω_base·ψ_d0 = V. The slides keep M/L_R before it, so their base speed is L_R/M times as high.
inline double base_speed_of_book_rad_s(const InductionMachineModel& machine, double rated_flux_wb,
                                       double voltage_v) noexcept {
  return voltage_v / (machine.pole_pairs * rated_flux_wb);
}

inline double base_speed_of_slides_rad_s(const InductionMachineModel& machine, double rated_flux_wb,
                                         double voltage_v) noexcept {
  return base_speed_of_book_rad_s(machine, rated_flux_wb, voltage_v) * machine.rotor_inductance_h /
         machine.mutual_inductance_h;
}

}  // namespace drivebench::control
