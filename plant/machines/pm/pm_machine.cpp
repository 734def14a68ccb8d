#include "plant/machines/pm/pm_machine.hpp"

#include <algorithm>
#include <cmath>

namespace drivebench {

PmMachineParameters two_phase_equivalent(int pole_pairs, const PmMachinePhase& phase) noexcept {
  const double inductance_h = 1.5 * phase.self_inductance_h;
  return {.pole_pairs = pole_pairs,
          .stator_resistance_ohm = phase.resistance_ohm,
          .inductance_d_h = inductance_h,
          .inductance_q_h = inductance_h,
          .torque_constant_nm_per_a = std::sqrt(1.5) * phase.emf_constant_v_s,
          .star = true};
}

PmMachineConstants constants_of(const PmMachineParameters& p) noexcept {
  return {.pole_pairs = static_cast<double>(p.pole_pairs),
          .resistance_ohm = p.stator_resistance_ohm,
          .inductance_d_h = p.inductance_d_h,
          .inductance_q_h = p.inductance_q_h,
          .reluctance_d_per_h = 1.0 / p.inductance_d_h,
          .reluctance_q_per_h = 1.0 / p.inductance_q_h,
          .saliency_h = p.pole_pairs * (p.inductance_d_h - p.inductance_q_h),
          .torque_constant_nm_per_a = p.torque_constant_nm_per_a,
          .detent_torque_nm = p.detent_torque_nm};
}

PmMachineState restricted(const PmMachineConstants&, const PmMachineState& x, const RotorMotion&,
                          const TerminalInput& u) noexcept {
  const TwoPhase current_a = conducted({x.i_a_a, x.i_b_a}, u);
  return {.i_a_a = current_a.a, .i_b_a = current_a.b};
}

WindingValues open_circuit_voltages(const PmMachineConstants& c, const PmMachineState&,
                                    const RotorMotion& motion) noexcept {
  const double emf_v = c.torque_constant_nm_per_a * motion.speed_rad_s;
  return {.stator = {-emf_v * motion.electrical.sin, emf_v * motion.electrical.cos}};
}

WindingValues winding_voltages(const PmMachineConstants& c, const PmMachineState& x,
                               const RotorMotion& motion, const TerminalInput& u) noexcept {
  const PmMachineState slope = derivative(c, x, motion, u);
  const TwoPhase emf_v = open_circuit_voltages(c, x, motion).stator;
  const Dq current_a = to_dq({x.i_a_a, x.i_b_a}, motion.electrical);
  const Dq slope_a_s = to_dq({slope.i_a_a, slope.i_b_a}, motion.electrical);
  const double rate_ohm = c.saliency_h * motion.speed_rad_s;
  const Dq induced_v = {.d = c.inductance_d_h * slope_a_s.d + rate_ohm * current_a.q,
                        .q = c.inductance_q_h * slope_a_s.q + rate_ohm * current_a.d};
  const TwoPhase stator_v = to_ab(induced_v, motion.electrical);
  return {.stator = {c.resistance_ohm * x.i_a_a + stator_v.a + emf_v.a,
                     c.resistance_ohm * x.i_b_a + stator_v.b + emf_v.b}};
}

TwoPhase rotor_flux_wb(const PmMachineConstants& c, const PmMachineState&,
                       const RotorMotion& motion) noexcept {
  const double flux_wb = c.torque_constant_nm_per_a / c.pole_pairs;
  return {.a = flux_wb * motion.electrical.cos, .b = flux_wb * motion.electrical.sin};
}

double stored_energy_j(const PmMachineConstants& c, const PmMachineState& x,
                       const RotorMotion& motion) noexcept {
  const Dq i = to_dq({x.i_a_a, x.i_b_a}, motion.electrical);
  const double sin2 = 2.0 * motion.electrical.sin * motion.electrical.cos;
  // 1 - cos 4 n_p theta = 2 sin^2 2 n_p theta.
  const double detent_j = 0.5 * c.detent_torque_nm / c.pole_pairs * sin2 * sin2;
  return 0.5 * (c.inductance_d_h * i.d * i.d + c.inductance_q_h * i.q * i.q) + detent_j;
}

double losses_w(const PmMachineConstants& c, const PmMachineState& x, const RotorMotion&) noexcept {
  return c.resistance_ohm * (x.i_a_a * x.i_a_a + x.i_b_a * x.i_b_a);
}

Connection connection_of(const PmMachineParameters& p) noexcept {
  return p.star ? Connection::kStar : Connection::kTwoPhase;
}

double pole_pairs_of(const PmMachineParameters& p) noexcept {
  return static_cast<double>(p.pole_pairs);
}

PmMachineParameters adjusted(const PmMachineParameters& p, const Adjustment& a) noexcept {
  PmMachineParameters result = p;
  result.stator_resistance_ohm =
      p.stator_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.inductance_d_h = p.inductance_d_h + a.series_inductance_h;
  result.inductance_q_h = p.inductance_q_h + a.series_inductance_h;
  result.torque_constant_nm_per_a = p.torque_constant_nm_per_a * a.magnet_factor;
  result.detent_torque_nm = p.detent_torque_nm * a.magnet_factor * a.magnet_factor;
  return result;
}

double fastest_time_constant_s(const PmMachineParameters& p) noexcept {
  return std::min(p.inductance_d_h, p.inductance_q_h) / p.stator_resistance_ohm;
}

double electrical_speed_rad_s(const PmMachineParameters& p, double voltage_v) noexcept {
  return p.torque_constant_nm_per_a > 0.0 ? p.pole_pairs * voltage_v / p.torque_constant_nm_per_a : 0.0;
}

}  // namespace drivebench
