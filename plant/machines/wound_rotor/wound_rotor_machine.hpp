#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Synchronous machine with a field winding on a round rotor, no damper, no saturation: two phases, or the
/// two-phase equivalent (power-invariant transform) of three.
///
/// The field quantities are those of one winding F whose terminals take the power u_F i_F: M, L_F and
/// R_F are as measured at the field terminals. A three-phase rotor that carries (i_f, -i_f/2, -i_f/2) is
/// i_F = sqrt(3/2) i_f, u_F = sqrt(3/2) u_R1 with R_F, L_F and M those of its two-phase equivalent. Source:
/// the book, chapter 7, problem 27.
struct WoundRotorMachineParameters {
  int pole_pairs = 1;
  double stator_resistance_ohm = 0.0;
  double field_resistance_ohm = 0.0;
  double stator_inductance_h = 0.0;
  double field_inductance_h = 0.0;
  double mutual_inductance_h = 0.0;  ///< largest, between a stator winding and the field
  bool star = false;  ///< three phases in an isolated star, given by their two-phase equivalent; else two
};

/// Leakage factor sigma = 1 - M^2/(L_S L_F); the machine exists for 0 < sigma <= 1 only.
double leakage_factor(const WoundRotorMachineParameters& p) noexcept;

/// The constants that the equations use, derived once from the parameters.
struct WoundRotorMachineConstants {
  double pole_pairs;
  double stator_resistance_ohm;    ///< R_S
  double field_resistance_ohm;     ///< R_F
  double stator_inductance_h;      ///< L_S
  double field_inductance_h;       ///< L_F
  double mutual_inductance_h;      ///< M
  double stator_reluctance_per_h;  ///< 1/L_S
  double coupling;                 ///< M/L_S [1]
};

/// The constants of a machine whose parameters are free of problems.
WoundRotorMachineConstants constants_of(const WoundRotorMachineParameters& p) noexcept;

/// Stator currents in the stator frame (axes a, b) and field current.
struct WoundRotorMachineState {
  double i_a_a = 0.0;
  double i_b_a = 0.0;
  double i_field_a = 0.0;
};

/// Motor convention, rotation positive from phase a to phase b, field along phase a at theta = 0. With
/// e = (cos n_p theta, sin n_p theta), e' = n_p w (-sin, cos):
///   u   = R_S i   + L_S i'   + M (i_F' e + i_F e')
///   u_F = R_F i_F + L_F i_F' + M (i' · e + i · e')
/// solved for the slopes; of e and of the voltage only the part counts along which the stator conducts.
/// Source: the book, (6.38).
inline WoundRotorMachineState derivative(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                         const RotorMotion& motion, const TerminalInput& u) noexcept {
  const CosSin e = motion.electrical;
  const double rate_h = c.pole_pairs * motion.speed_rad_s * c.mutual_inductance_h;
  const TwoPhase v =
      conducted({u.voltage_v.a - c.stator_resistance_ohm * x.i_a_a + rate_h * x.i_field_a * e.sin,
                 u.voltage_v.b - c.stator_resistance_ohm * x.i_b_a - rate_h * x.i_field_a * e.cos},
                u);
  const double v_field =
      u.field_v - c.field_resistance_ohm * x.i_field_a - rate_h * (x.i_b_a * e.cos - x.i_a_a * e.sin);
  const TwoPhase axis = conducted({e.cos, e.sin}, u);
  const double i_field_slope =
      (v_field - c.coupling * (axis.a * v.a + axis.b * v.b)) /
      (c.field_inductance_h - c.coupling * c.mutual_inductance_h * (axis.a * axis.a + axis.b * axis.b));
  return {.i_a_a = c.stator_reluctance_per_h * v.a - c.coupling * axis.a * i_field_slope,
          .i_b_a = c.stator_reluctance_per_h * v.b - c.coupling * axis.b * i_field_slope,
          .i_field_a = i_field_slope};
}

/// Torque on the rotor: n_p M i_F i_q, where i_q lies across the field. Source: the book, (6.38).
inline double torque_nm(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                        const RotorMotion& motion) noexcept {
  return c.pole_pairs * c.mutual_inductance_h * x.i_field_a *
         (x.i_b_a * motion.electrical.cos - x.i_a_a * motion.electrical.sin);
}

inline WindingValues winding_currents(const WoundRotorMachineConstants&, const WoundRotorMachineState& x,
                                      const RotorMotion&) noexcept {
  return {.stator = {x.i_a_a, x.i_b_a}, .field = x.i_field_a};
}

/// The state with the part of the stator current removed that the circuit does not let flow. The flux of the
/// field winding stays, so that the field current takes over what the stator did.
WoundRotorMachineState restricted(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                  const RotorMotion& motion, const TerminalInput& u) noexcept;

/// Voltages of the windings where no current flows in the stator and none changes, nor that of the field.
WindingValues open_circuit_voltages(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// The same while the field has this voltage: what the slope of its current induces comes on top.
WindingValues open_circuit_voltages(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                    const RotorMotion& motion, double field_v) noexcept;

/// Voltages of the windings with the currents that `u` lets flow: R i + d(flux)/dt. Where the stator is open
/// this holds what a changing field current induces as well.
WindingValues winding_voltages(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                               const RotorMotion& motion, const TerminalInput& u) noexcept;

/// The voltages of open windings while the others carry the currents that `u` lets flow.
inline WindingValues floating_voltages(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                                       const RotorMotion& motion, const TerminalInput& u) noexcept {
  return winding_voltages(c, x, motion, u);
}

/// Flux of the field in the stator windings, M i_F e, in the stator frame.
TwoPhase rotor_flux_wb(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Magnetic energy: L_S |i|^2/2 + L_F i_F^2/2 + M i_F (i · e).
double stored_energy_j(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Copper losses R_S |i|^2 + R_F i_F^2.
double losses_w(const WoundRotorMachineConstants& c, const WoundRotorMachineState& x,
                const RotorMotion& motion) noexcept;

Connection connection_of(const WoundRotorMachineParameters& p) noexcept;
/// Turns of the electrical angle for one of the shaft.
double pole_pairs_of(const WoundRotorMachineParameters& p) noexcept;
WoundRotorMachineParameters adjusted(const WoundRotorMachineParameters& p, const Adjustment& a) noexcept;
/// The fastest electrical time constant at standstill. The substep must resolve n_p w as well.
double fastest_time_constant_s(const WoundRotorMachineParameters& p) noexcept;

/// Fastest swing of the rotor about the direction of a stator that a source feeds, n_p sqrt(M i_F i_S / J):
/// with the field current u_F/R_F, and with the stator current that the source drives through R_S and the
/// leakage before the rotor turns. The amplitude is that of the two-phase equivalent.
double swing_rad_s(const WoundRotorMachineParameters& p, double inertia_kgm2, double amplitude_v,
                   double electrical_rad_s, double field_v) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct WoundRotorMachine {
  using Parameters = WoundRotorMachineParameters;
  using Constants = WoundRotorMachineConstants;
  using State = WoundRotorMachineState;
  static constexpr bool kUsesAngle = true;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
