#include "plant/machines/induction/induction_machine.hpp"

#include <cmath>

namespace drivebench {

double leakage_factor(const InductionMachineParameters& p) noexcept {
  return 1.0 - p.mutual_inductance_h * p.mutual_inductance_h / (p.rotor_inductance_h * p.stator_inductance_h);
}

InductionMachineParameters terminal_equivalent(const InductionMachineTerminals& t) noexcept {
  return {.pole_pairs = t.pole_pairs,
          .stator_resistance_ohm = t.stator_resistance_ohm,
          .rotor_resistance_ohm = t.stator_inductance_h / t.rotor_time_constant_s,
          .stator_inductance_h = t.stator_inductance_h,
          .rotor_inductance_h = t.stator_inductance_h,
          .mutual_inductance_h = t.stator_inductance_h * std::sqrt(1.0 - t.leakage_factor),
          .star = t.star};
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

InductionMachineState restricted(const InductionMachineConstants&, const InductionMachineState& x,
                                 const RotorMotion&, const TerminalInput& u) noexcept {
  const TwoPhase current_a = conducted({x.i_a_a, x.i_b_a}, u);
  return {.i_a_a = current_a.a, .i_b_a = current_a.b, .psi_a_wb = x.psi_a_wb, .psi_b_wb = x.psi_b_wb};
}

TwoPhase rotor_flux_wb(const InductionMachineConstants&, const InductionMachineState& x,
                       const RotorMotion&) noexcept {
  return {x.psi_a_wb, x.psi_b_wb};
}

double stored_energy_j(const InductionMachineConstants& c, const InductionMachineState& x,
                       const RotorMotion&) noexcept {
  return 0.5 * c.transient_inductance_h * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a) +
         0.5 / c.rotor_inductance_h * (x.psi_a_wb * x.psi_a_wb + x.psi_b_wb * x.psi_b_wb);
}

double losses_w(const InductionMachineConstants& c, const InductionMachineState& x,
                const RotorMotion&) noexcept {
  const double i_ra_a = (x.psi_a_wb - c.mutual_inductance_h * x.i_a_a) / c.rotor_inductance_h;
  const double i_rb_a = (x.psi_b_wb - c.mutual_inductance_h * x.i_b_a) / c.rotor_inductance_h;
  return c.stator_resistance_ohm * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a) +
         c.rotor_resistance_ohm * (i_ra_a * i_ra_a + i_rb_a * i_rb_a);
}

Connection connection_of(const InductionMachineParameters& p) noexcept {
  return p.star ? Connection::kStar : Connection::kTwoPhase;
}

double pole_pairs_of(const InductionMachineParameters&) noexcept {
  return 0.0;
}

InductionMachineParameters adjusted(const InductionMachineParameters& p, const Adjustment& a) noexcept {
  InductionMachineParameters result = p;
  result.stator_resistance_ohm =
      p.stator_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.rotor_resistance_ohm = p.rotor_resistance_ohm * a.rotor_resistance_factor;
  result.stator_inductance_h = p.stator_inductance_h + a.series_inductance_h;
  return result;
}

double fastest_time_constant_s(const InductionMachineParameters& p) noexcept {
  // The larger root of s^2 - (gamma + eta) s + eta R_S/(sigma L_S) = 0: current and flux along one axis.
  const InductionMachineConstants c = constants_of(p);
  const double half = 0.5 * (c.gamma_per_s + c.eta_per_s);
  const double product = c.eta_per_s * c.stator_resistance_ohm * c.transient_reluctance_per_h;
  return 1.0 / (half + std::sqrt(half * half - product));
}

}  // namespace drivebench
