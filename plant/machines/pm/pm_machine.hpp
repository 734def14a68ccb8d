#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Synchronous machine with permanent magnets or hybrid stepping motor, no saturation: two phases, or the
/// two-phase equivalent (power-invariant transform) of three.
struct PmMachineParameters {
  int pole_pairs = 1;  ///< of a hybrid stepping motor: the teeth of its rotor, usually 50
  double stator_resistance_ohm = 0.0;
  double inductance_d_h = 0.0;            ///< along the magnet; L_S + L_g of the book
  double inductance_q_h = 0.0;            ///< across the magnet; L_S - L_g; a round rotor has both alike
  double torque_constant_nm_per_a = 0.0;  ///< K_m, also in V·s/rad: n_p times the flux of the magnet
  double detent_torque_nm = 0.0;          ///< amplitude of the torque that is there without a current
  bool star = false;  ///< three phases in an isolated star, given by their two-phase equivalent; else two
};

/// One phase of a three-phase machine with a round rotor.
struct PmMachinePhase {
  double resistance_ohm = 0.0;
  double self_inductance_h = 0.0;  ///< L; between two phases it is -L/2
  double emf_constant_v_s = 0.0;   ///< K: peak of the phase voltage over the speed of the shaft [V·s/rad]
};

/// The star of three such phases: R_S = R, L_S = 3 L/2, K_m = sqrt(3/2) K. Source: the book, (7.80).
PmMachineParameters two_phase_equivalent(int pole_pairs, const PmMachinePhase& phase) noexcept;

/// The constants that the equations use, derived once from the parameters.
struct PmMachineConstants {
  double pole_pairs;
  double resistance_ohm;      ///< R_S
  double inductance_d_h;      ///< L_d
  double inductance_q_h;      ///< L_q
  double reluctance_d_per_h;  ///< 1/L_d
  double reluctance_q_per_h;  ///< 1/L_q
  double saliency_h;          ///< n_p (L_d - L_q) = 2 n_p L_g; zero selects the equations of a round rotor
  double torque_constant_nm_per_a;  ///< K_m
  double detent_torque_nm;          ///< T_d
};

/// The constants of a machine whose parameters are free of problems.
PmMachineConstants constants_of(const PmMachineParameters& p) noexcept;

/// Stator currents in the stator frame (axes a, b): an open phase is a fixed direction there, so that its
/// current stays exactly zero. Currents along and across the magnet are not more exact at high speed.
struct PmMachineState {
  double i_a_a = 0.0;
  double i_b_a = 0.0;
};

namespace pm_machine_detail {

/// The slopes of the currents of a salient machine along (d) and across (q) the magnet, seen from the stator:
///   L_d s_d = u_d - R_S i_d - n_p w (L_d - L_q) i_q
///   L_q s_q = u_q - R_S i_q - n_p w (L_d - L_q) i_d - K_m w
/// If current flows only along a line l, it is (L_d l_d^2 + L_q l_q^2) s = l · (the right sides): the
/// inductance is not the same in every direction.
inline TwoPhase salient_slope(const PmMachineConstants& c, const PmMachineState& x, const RotorMotion& motion,
                              const TerminalInput& u) noexcept {
  const double rate_ohm = c.saliency_h * motion.speed_rad_s;
  const Dq i = to_dq({x.i_a_a, x.i_b_a}, motion.electrical);
  const Dq applied =
      to_dq({u.voltage_v.a - c.resistance_ohm * x.i_a_a, u.voltage_v.b - c.resistance_ohm * x.i_b_a},
            motion.electrical);
  const Dq v = {.d = applied.d - rate_ohm * i.q,
                .q = applied.q - (c.torque_constant_nm_per_a * motion.speed_rad_s + rate_ohm * i.d)};
  if (u.conduction == Conduction::kFull)
    return to_ab({.d = c.reluctance_d_per_h * v.d, .q = c.reluctance_q_per_h * v.q}, motion.electrical);
  if (u.conduction == Conduction::kNone) return {.a = 0.0, .b = 0.0};
  const Dq l = to_dq(u.line, motion.electrical);
  const double along =
      (l.d * v.d + l.q * v.q) / (c.inductance_d_h * l.d * l.d + c.inductance_q_h * l.q * l.q);
  return {.a = along * u.line.a, .b = along * u.line.b};
}

}  // namespace pm_machine_detail

/// Motor convention, rotation positive from phase a to phase b, magnet along phase a at theta = 0:
///   L_S i_a' = u_a - R_S i_a + K_m w sin(n_p theta)
///   L_S i_b' = u_b - R_S i_b - K_m w cos(n_p theta)
/// and with L_d != L_q as in salient_slope(). Source: the book, (6.40), (9.1); the signs printed in
/// (7.81) are wrong.
inline PmMachineState derivative(const PmMachineConstants& c, const PmMachineState& x,
                                 const RotorMotion& motion, const TerminalInput& u) noexcept {
  if (c.saliency_h != 0.0) {
    const TwoPhase slope = pm_machine_detail::salient_slope(c, x, motion, u);
    return {.i_a_a = slope.a, .i_b_a = slope.b};
  }
  const double emf_v = c.torque_constant_nm_per_a * motion.speed_rad_s;
  const double v_a = u.voltage_v.a - c.resistance_ohm * x.i_a_a + emf_v * motion.electrical.sin;
  const double v_b = u.voltage_v.b - c.resistance_ohm * x.i_b_a - emf_v * motion.electrical.cos;
  const TwoPhase slope = conducted({v_a * c.reluctance_d_per_h, v_b * c.reluctance_d_per_h}, u);
  return {.i_a_a = slope.a, .i_b_a = slope.b};
}

/// Torque on the rotor: K_m i_q + n_p (L_d - L_q) i_d i_q - T_d sin(4 n_p theta). Source: the book,
/// (9.1), and problem 11 of chapter 9, whose printed torque is corrected.
inline double torque_nm(const PmMachineConstants& c, const PmMachineState& x,
                        const RotorMotion& motion) noexcept {
  const CosSin e = motion.electrical;
  const Dq i = to_dq({x.i_a_a, x.i_b_a}, e);
  const double sin4 = 4.0 * e.sin * e.cos * (e.cos * e.cos - e.sin * e.sin);
  return (c.torque_constant_nm_per_a + c.saliency_h * i.d) * i.q - c.detent_torque_nm * sin4;
}

inline WindingValues winding_currents(const PmMachineConstants&, const PmMachineState& x,
                                      const RotorMotion&) noexcept {
  return {.stator = {x.i_a_a, x.i_b_a}};
}

/// The state with the part of the stator current removed that the circuit does not let flow.
PmMachineState restricted(const PmMachineConstants& c, const PmMachineState& x, const RotorMotion& motion,
                          const TerminalInput& u) noexcept;

/// Voltages of the windings where no current flows and none changes.
WindingValues open_circuit_voltages(const PmMachineConstants& c, const PmMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// Voltages of the windings with the currents that `u` lets flow: R i + d(flux)/dt. An open
/// phase of a salient machine shows its voltage while the other two carry current.
WindingValues winding_voltages(const PmMachineConstants& c, const PmMachineState& x,
                               const RotorMotion& motion, const TerminalInput& u) noexcept;

/// The voltages of open windings while the others carry the currents that `u` lets flow; those of a round
/// machine do not depend on these currents.
inline WindingValues floating_voltages(const PmMachineConstants& c, const PmMachineState& x,
                                       const RotorMotion& motion, const TerminalInput& u) noexcept {
  return c.saliency_h != 0.0 ? winding_voltages(c, x, motion, u) : open_circuit_voltages(c, x, motion);
}

/// Flux of the magnet in the stator windings, in the stator frame.
TwoPhase rotor_flux_wb(const PmMachineConstants& c, const PmMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Magnetic energy: (L_d i_d^2 + L_q i_q^2)/2, and what the detent torque stores, least where it is at rest.
double stored_energy_j(const PmMachineConstants& c, const PmMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Copper losses R_S |i|^2.
double losses_w(const PmMachineConstants& c, const PmMachineState& x, const RotorMotion& motion) noexcept;

Connection connection_of(const PmMachineParameters& p) noexcept;
/// Turns of the electrical angle for one of the shaft.
double pole_pairs_of(const PmMachineParameters& p) noexcept;
/// K_m goes with the magnet, the detent torque with its square.
PmMachineParameters adjusted(const PmMachineParameters& p, const Adjustment& a) noexcept;
/// The fastest electrical time constant at standstill, min(L_d, L_q)/R_S. The substep must resolve n_p w as
/// well.
double fastest_time_constant_s(const PmMachineParameters& p) noexcept;

/// Electrical angular speed at which the emf reaches a voltage; 0 without a magnet.
double electrical_speed_rad_s(const PmMachineParameters& p, double voltage_v) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct PmMachine {
  using Parameters = PmMachineParameters;
  using Constants = PmMachineConstants;
  using State = PmMachineState;
  static constexpr bool kUsesAngle = true;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
