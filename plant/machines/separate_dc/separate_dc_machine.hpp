#pragma once

#include "plant/machines/field_winding.hpp"
#include "plant/windings.hpp"

namespace drivebench {

/// DC machine whose field winding has a supply of its own: TerminalInput::field_v. The armature is winding a.
struct SeparateDcMachineParameters {
  double armature_resistance_ohm = 0.0;  ///< R
  double armature_inductance_h = 0.0;    ///< L
  double motor_constant = 0.0;           ///< K_m, torque over field flux linkage and armature current [1]
  double field_resistance_ohm = 0.0;     ///< R_f
  double field_inductance_h = 0.0;       ///< L_f; without a saturation curve
  Curve saturation_curve{};              ///< lambda_f [Wb] over i_f [A], from (0, 0) on, odd
  bool field_coupling = false;           ///< a changing field induces a voltage in the armature
  int armature_loops = 1;                ///< n, loops in each parallel path; for the coupling only
};

struct SeparateDcMachineConstants {
  double resistance_ohm;
  double inductance_h;
  double per_inductance;  ///< 1/L [1/H]
  double motor_constant;  ///< K_m
  double field_resistance_ohm;
  double coupling_per_rad;  ///< K_m/n, or 0 without the coupling
  double segments_per_rad;  ///< n/pi: periods of the sawtooth in a radian
  FieldWinding field;
};

/// The constants of a machine whose parameters are free of problems().
SeparateDcMachineConstants constants_of(const SeparateDcMachineParameters& p) noexcept;

struct SeparateDcMachineState {
  double i_a_a = 0.0;
  double field_flux_wb = 0.0;  ///< lambda_f
};

/// Flux linkage of an armature path per l_1 l_2 B: a sawtooth that falls from pi/2 to -pi/2 in each segment
/// of the commutator, pi/n of the shaft.
double commutator_sawtooth(const SeparateDcMachineConstants& c, double angle_rad) noexcept;

///   L i'        = -R i + [(dlambda/di_f) i_f'] - K_m lambda_f w + u
///   lambda_f'   = -R_f i_f + u_f,            i_f = f^-1(lambda_f)
/// The term in brackets is there with field_coupling only. lambda(i_f, theta) = (K_m/n) lambda_f times the
/// sawtooth of the commutator is what the field links with a path of the armature; its mean over a segment is
/// zero. The book's model has no term of the armature current in the field equation, so power balances with
/// the coupling off: u i + u_f i_f = R i^2 + R_f i_f^2 + (L i^2/2)' + i_f lambda_f' + torque w. With the
/// coupling on, i (dlambda/di_f) i_f' comes from nowhere: use it to see the voltage, not for energy audits.
/// The steps of the sawtooth are not split. Source: the book, (1.19)-(1.21).
inline SeparateDcMachineState derivative(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                                         const RotorMotion& motion, const TerminalInput& u) noexcept {
  const double flux_slope = u.field_v - c.field_resistance_ohm * field_current_a(c.field, x.field_flux_wb);
  if (u.conduction == Conduction::kNone) return {.i_a_a = 0.0, .field_flux_wb = flux_slope};
  double voltage_v =
      u.voltage_v.a - c.resistance_ohm * x.i_a_a - c.motor_constant * x.field_flux_wb * motion.speed_rad_s;
  if (c.coupling_per_rad != 0.0)
    voltage_v += c.coupling_per_rad * commutator_sawtooth(c, motion.angle_rad) * flux_slope;
  return {.i_a_a = voltage_v * c.per_inductance, .field_flux_wb = flux_slope};
}

/// Torque on the rotor: K_m lambda_f i.
inline double torque_nm(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                        const RotorMotion&) noexcept {
  return c.motor_constant * x.field_flux_wb * x.i_a_a;
}

/// The armature current and the field current.
inline WindingValues winding_currents(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                                      const RotorMotion&) noexcept {
  return {.stator = {x.i_a_a, 0.0}, .field = field_current_a(c.field, x.field_flux_wb)};
}

/// The state with the part of the armature current removed that the circuit does not let flow.
SeparateDcMachineState restricted(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                                  const RotorMotion& motion, const TerminalInput& u) noexcept;

/// The back-emf K_m lambda_f w.
WindingValues open_circuit_voltages(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// lambda_f, on axis a.
TwoPhase rotor_flux_wb(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// L i^2/2 and the energy of the field, the integral of i_f over lambda_f.
double stored_energy_j(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// R i^2 + R_f i_f^2.
double losses_w(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                const RotorMotion& motion) noexcept;

Connection connection_of(const SeparateDcMachineParameters& p) noexcept;
/// 0: the equations do not know the electrical angle.
double pole_pairs_of(const SeparateDcMachineParameters& p) noexcept;
SeparateDcMachineParameters adjusted(const SeparateDcMachineParameters& p, const Adjustment& a) noexcept;
/// L/R or, saturated, L_f/R_f, whichever is less: sets the substep.
double fastest_time_constant_s(const SeparateDcMachineParameters& p) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct SeparateDcMachine {
  using Parameters = SeparateDcMachineParameters;
  using Constants = SeparateDcMachineConstants;
  using State = SeparateDcMachineState;
  static constexpr bool kUsesAngle = false;  ///< the coupling reads that of the shaft
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
