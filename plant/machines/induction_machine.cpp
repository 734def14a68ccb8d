#include "plant/machines/induction_machine.hpp"

namespace drivebench {

double leakage_factor(const InductionMachineParameters& p) noexcept {
  return 1.0 - p.mutual_inductance_h * p.mutual_inductance_h / (p.rotor_inductance_h * p.stator_inductance_h);
}

InductionMachineConstants constants_of(const InductionMachineParameters& p) noexcept {
  const double sigma = leakage_factor(p);
  const double eta_per_s = p.rotor_resistance_ohm / p.rotor_inductance_h;
  const double transient_inductance_h = sigma * p.stator_inductance_h;
  const double beta_per_h = p.mutual_inductance_h / (p.rotor_inductance_h * transient_inductance_h);
  return {.pole_pairs = static_cast<double>(p.pole_pairs),
          .sigma = sigma,
          .eta_per_s = eta_per_s,
          .beta_per_h = beta_per_h,
          .gamma_per_s = p.mutual_inductance_h * eta_per_s * beta_per_h +
                         p.stator_resistance_ohm / transient_inductance_h,
          .mutual_inductance_h = p.mutual_inductance_h,
          .transient_inductance_h = transient_inductance_h,
          .transient_reluctance_per_h = 1.0 / transient_inductance_h,
          .torque_constant = p.pole_pairs * p.mutual_inductance_h / p.rotor_inductance_h,
          .stator_resistance_ohm = p.stator_resistance_ohm,
          .rotor_resistance_ohm = p.rotor_resistance_ohm,
          .rotor_inductance_h = p.rotor_inductance_h};
}

TwoPhase open_circuit_voltage_v(const InductionMachineConstants& c, const InductionMachineState& x,
                                double speed_rad_s) noexcept {
  const double omega_e = c.pole_pairs * speed_rad_s;
  const double flux_ratio = c.transient_inductance_h * c.beta_per_h;
  return {-flux_ratio * (c.eta_per_s * x.psi_a_wb + omega_e * x.psi_b_wb),
          -flux_ratio * (c.eta_per_s * x.psi_b_wb - omega_e * x.psi_a_wb)};
}

double stored_energy_j(const InductionMachineConstants& c, const InductionMachineState& x) noexcept {
  return 0.5 * c.transient_inductance_h * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a) +
         0.5 / c.rotor_inductance_h * (x.psi_a_wb * x.psi_a_wb + x.psi_b_wb * x.psi_b_wb);
}

double losses_w(const InductionMachineConstants& c, const InductionMachineState& x) noexcept {
  const double i_ra_a = (x.psi_a_wb - c.mutual_inductance_h * x.i_a_a) / c.rotor_inductance_h;
  const double i_rb_a = (x.psi_b_wb - c.mutual_inductance_h * x.i_b_a) / c.rotor_inductance_h;
  return c.stator_resistance_ohm * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a) +
         c.rotor_resistance_ohm * (i_ra_a * i_ra_a + i_rb_a * i_rb_a);
}

}  // namespace drivebench
