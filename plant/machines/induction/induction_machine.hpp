#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Two-phase equivalent of a squirrel-cage induction machine (power-invariant transform), no saturation.
struct InductionMachineParameters {
  int pole_pairs = 1;
  double stator_resistance_ohm = 0.0;
  double rotor_resistance_ohm = 0.0;
  double stator_inductance_h = 0.0;
  double rotor_inductance_h = 0.0;
  double mutual_inductance_h = 0.0;
  bool star = false;  ///< three phases in an isolated star, given by their two-phase equivalent; else two
};

/// Leakage factor sigma = 1 - M^2/(L_R L_S); the machine exists for 0 < sigma < 1 only.
double leakage_factor(const InductionMachineParameters& p) noexcept;

/// The parameters that measurements at the terminals of a machine can determine.
struct InductionMachineTerminals {
  int pole_pairs = 1;
  double stator_resistance_ohm = 0.0;  ///< R_S
  double stator_inductance_h = 0.0;    ///< L_S
  double leakage_factor = 0.0;         ///< sigma
  double rotor_time_constant_s = 0.0;  ///< T_R = L_R/R_R
  bool star = false;
};

/// The machine with L_R = L_S that behaves so; all others that do have (k M, k^2 L_R, k^2 R_R) and a rotor
/// flux k times as large. Source: the book, (8.132).
InductionMachineParameters terminal_equivalent(const InductionMachineTerminals& t) noexcept;

/// The constants that the equations use, derived once from the parameters. Source: the book, (8.6).
struct InductionMachineConstants {
  double pole_pairs;
  double sigma;                       ///< leakage factor [1]
  double eta_per_s;                   ///< R_R/L_R
  double beta_per_h;                  ///< M/(sigma L_R L_S)
  double gamma_per_s;                 ///< M^2 R_R/(sigma L_R^2 L_S) + R_S/(sigma L_S)
  double mutual_inductance_h;         ///< M
  double transient_inductance_h;      ///< sigma L_S
  double transient_reluctance_per_h;  ///< 1/(sigma L_S)
  double torque_constant;             ///< n_p M/L_R [1]; J mu of the book
  double stator_resistance_ohm;       ///< R_S
  double rotor_resistance_ohm;        ///< R_R
  double rotor_inductance_h;          ///< L_R
};

/// The constants of a machine whose parameters are free of problems().
InductionMachineConstants constants_of(const InductionMachineParameters& p) noexcept;

/// Stator currents and rotor flux linkages, all in the stator frame (axes a, b).
struct InductionMachineState {
  double i_a_a = 0.0;
  double i_b_a = 0.0;
  double psi_a_wb = 0.0;
  double psi_b_wb = 0.0;
};

/// Rotor-flux model, motor convention, rotation positive from phase a to phase b:
///   i_a'   = eta beta psi_a + beta n_p w psi_b - gamma i_a + u_a/(sigma L_S)
///   i_b'   = eta beta psi_b - beta n_p w psi_a - gamma i_b + u_b/(sigma L_S)
///   psi_a' = -eta psi_a - n_p w psi_b + eta M i_a
///   psi_b' = -eta psi_b + n_p w psi_a + eta M i_b
/// No sine of the angle occurs. Source: the book, (8.3)-(8.6).
inline InductionMachineState derivative(const InductionMachineConstants& c, const InductionMachineState& x,
                                        const RotorMotion& motion, const TerminalInput& u) noexcept {
  const double omega_e = c.pole_pairs * motion.speed_rad_s;
  const double emf_a = c.beta_per_h * (c.eta_per_s * x.psi_a_wb + omega_e * x.psi_b_wb);
  const double emf_b = c.beta_per_h * (c.eta_per_s * x.psi_b_wb - omega_e * x.psi_a_wb);
  const TwoPhase slope =
      conducted({emf_a - c.gamma_per_s * x.i_a_a + u.voltage_v.a * c.transient_reluctance_per_h,
                 emf_b - c.gamma_per_s * x.i_b_a + u.voltage_v.b * c.transient_reluctance_per_h},
                u);
  return {
      .i_a_a = slope.a,
      .i_b_a = slope.b,
      .psi_a_wb = c.eta_per_s * (c.mutual_inductance_h * x.i_a_a - x.psi_a_wb) - omega_e * x.psi_b_wb,
      .psi_b_wb = c.eta_per_s * (c.mutual_inductance_h * x.i_b_a - x.psi_b_wb) + omega_e * x.psi_a_wb,
  };
}

/// Torque on the rotor: n_p (M/L_R) (i_b psi_a - i_a psi_b). Source: the book, (8.3).
inline double torque_nm(const InductionMachineConstants& c, const InductionMachineState& x,
                        const RotorMotion&) noexcept {
  return c.torque_constant * (x.i_b_a * x.psi_a_wb - x.i_a_a * x.psi_b_wb);
}

inline WindingValues winding_currents(const InductionMachineConstants&, const InductionMachineState& x,
                                      const RotorMotion&) noexcept {
  return {.stator = {x.i_a_a, x.i_b_a}};
}

/// The state with the part of the stator current removed that the circuit does not let flow.
InductionMachineState restricted(const InductionMachineConstants& c, const InductionMachineState& x,
                                 const RotorMotion& motion, const TerminalInput& u) noexcept;

/// Voltages of the windings where no current flows and none changes.
inline WindingValues open_circuit_voltages(const InductionMachineConstants& c, const InductionMachineState& x,
                                           const RotorMotion& motion) noexcept {
  const double omega_e = c.pole_pairs * motion.speed_rad_s;
  const double flux_ratio = c.transient_inductance_h * c.beta_per_h;
  return {.stator = {-flux_ratio * (c.eta_per_s * x.psi_a_wb + omega_e * x.psi_b_wb),
                     -flux_ratio * (c.eta_per_s * x.psi_b_wb - omega_e * x.psi_a_wb)}};
}

/// Rotor flux linkage in the stator frame.
TwoPhase rotor_flux_wb(const InductionMachineConstants& c, const InductionMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Magnetic energy: sigma L_S |i|^2/2 + |psi|^2/(2 L_R).
double stored_energy_j(const InductionMachineConstants& c, const InductionMachineState& x,
                       const RotorMotion& motion) noexcept;

/// Copper losses of stator and rotor: R_S |i|^2 + R_R |i_R|^2 with i_R = (psi - M i)/L_R.
double losses_w(const InductionMachineConstants& c, const InductionMachineState& x,
                const RotorMotion& motion) noexcept;

Connection connection_of(const InductionMachineParameters& p) noexcept;
/// Turns of the electrical angle for one of the shaft; 0 where the equations do not know the angle.
double pole_pairs_of(const InductionMachineParameters& p) noexcept;
InductionMachineParameters adjusted(const InductionMachineParameters& p, const Adjustment& a) noexcept;
/// The fastest electrical time constant at standstill: sets the substep.
double fastest_time_constant_s(const InductionMachineParameters& p) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct InductionMachine {
  using Parameters = InductionMachineParameters;
  using Constants = InductionMachineConstants;
  using State = InductionMachineState;
  static constexpr bool kUsesAngle = false;   ///< the equations read the electrical angle
  static constexpr bool kHasCorners = false;  ///< they have kinks at certain angles: see corner_position()
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
