#pragma once

#include <array>
#include <cmath>
#include <complex>

#include "plant/machines/induction/induction_machine.hpp"

namespace drivebench {

/// An induction machine that turns steadily with rotor currents of one slip frequency: per volt of the
/// stator, all as two-phase space vectors. The voltage is real.
struct SteadyInduction {
  double torque_nm;  ///< per volt squared
  std::complex<double> current_a;
};

/// Solved from the machine's own derivative(), which is linear in state and voltage: x' = j (n_p w + slip) x.
inline SteadyInduction per_volt(const InductionMachineConstants& c, double speed_rad_s, double slip_rad_s) {
  using Complex = std::complex<double>;
  const RotorMotion motion{0.0, speed_rad_s, {1.0, 0.0}};
  const auto column = [&](const InductionMachineState& x, TwoPhase v) {
    const InductionMachineState d = derivative(c, x, motion, {.voltage_v = v});
    return std::array<Complex, 2>{Complex(d.i_a_a, d.i_b_a), Complex(d.psi_a_wb, d.psi_b_wb)};
  };
  const auto of_current = column({.i_a_a = 1.0}, {0.0, 0.0});
  const auto of_flux = column({.psi_a_wb = 1.0}, {0.0, 0.0});
  const auto of_voltage = column({}, {1.0, 0.0});
  const Complex rate(0.0, c.pole_pairs * speed_rad_s + slip_rad_s);
  const Complex a = of_current[0] - rate, b = of_flux[0], d = of_current[1], e = of_flux[1] - rate;
  const Complex det = a * e - b * d;
  const Complex i = -of_voltage[0] * e / det;
  const Complex psi = of_voltage[0] * d / det;
  return {torque_nm(c, {i.real(), i.imag(), psi.real(), psi.imag()}, motion), i};
}

}  // namespace drivebench
