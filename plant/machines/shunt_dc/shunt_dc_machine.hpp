#pragma once

#include "plant/machines/field_winding.hpp"
#include "plant/windings.hpp"

namespace drivebench {

/// DC machine whose field winding lies across the armature terminals, with an adjusting resistor.
struct ShuntDcMachineParameters {
  double armature_resistance_ohm = 0.0;   ///< R
  double armature_inductance_h = 0.0;     ///< L
  double motor_constant = 0.0;            ///< K_m, torque over field flux linkage and armature current [1]
  double field_resistance_ohm = 0.0;      ///< R_f of the winding
  double adjusting_resistance_ohm = 0.0;  ///< R_adj in series with the field
  double field_inductance_h = 0.0;        ///< L_f; without a saturation curve
  Curve saturation_curve{};               ///< lambda_f [Wb] over i_f [A], from (0, 0) on, odd
};

struct ShuntDcMachineConstants {
  double resistance_ohm;
  double inductance_h;
  double per_inductance;          ///< 1/L [1/H]
  double motor_constant;          ///< K_m
  double circuit_resistance_ohm;  ///< R_F = R_f + R_adj
  FieldWinding field;             ///< in a loop with L when the terminals are open
};

/// The constants of a machine whose parameters are free of problems().
ShuntDcMachineConstants constants_of(const ShuntDcMachineParameters& p) noexcept;

struct ShuntDcMachineState {
  double armature_a = 0.0;     ///< i, of the armature alone
  double field_flux_wb = 0.0;  ///< lambda_f
};

/// The slopes with open terminals. Armature and field are one loop then, i = -i_f, and drive each other; with
/// little resistance and enough speed the machine excites itself until the iron saturates:
///   (lambda_f - L i)' = K_m lambda_f w - (R + R_F) i_f
/// There is no remanence: it needs some field current to begin with. Cold: see SeriesDcMachine.
[[gnu::cold]] ShuntDcMachineState open_derivative(const ShuntDcMachineConstants& c, ShuntDcMachineState x,
                                                  double speed_rad_s) noexcept;

///   L i'      = -R i - K_m lambda_f w + u
///   lambda_f' = -R_F i_f + u,           i_f = f^-1(lambda_f),  R_F = R_f + R_adj
/// The terminals carry i + i_f. Source: the book, chapter 2, problem 46.
inline ShuntDcMachineState derivative(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                                      const RotorMotion& motion, const TerminalInput& u) noexcept {
  if (u.conduction == Conduction::kNone) return open_derivative(c, x, motion.speed_rad_s);
  return {
      .armature_a = (u.voltage_v.a - c.resistance_ohm * x.armature_a -
                     c.motor_constant * x.field_flux_wb * motion.speed_rad_s) *
                    c.per_inductance,
      .field_flux_wb = u.voltage_v.a - c.circuit_resistance_ohm * field_current_a(c.field, x.field_flux_wb)};
}

/// Torque on the rotor: K_m lambda_f i.
inline double torque_nm(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                        const RotorMotion&) noexcept {
  return c.motor_constant * x.field_flux_wb * x.armature_a;
}

/// stator.a is the current of the terminals, i + i_f: that is what diodes, converters and sensors meet, and u
/// times it is the power. The field current is a part of it; the armature has the rest.
inline WindingValues winding_currents(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                                      const RotorMotion&) noexcept {
  const double field_a = field_current_a(c.field, x.field_flux_wb);
  return {.stator = {x.armature_a + field_a, 0.0}, .field = field_a};
}

/// With open terminals: i = -i_f. The opening acts by the same voltage on armature and field, so that
/// lambda_f - L i stays; the magnetic energy of the terminal current burns in the arc.
ShuntDcMachineState restricted(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                               const RotorMotion& motion, const TerminalInput& u) noexcept;

/// Voltage of the open terminals: R_F i_f + lambda_f' of the loop.
WindingValues open_circuit_voltages(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// lambda_f, on axis a.
TwoPhase rotor_flux_wb(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// L i^2/2 and the energy of the field, the integral of i_f over lambda_f.
double stored_energy_j(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// R i^2 + R_F i_f^2, the adjusting resistor included.
double losses_w(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                const RotorMotion& motion) noexcept;

Connection connection_of(const ShuntDcMachineParameters& p) noexcept;
/// 0: the equations do not know the angle.
double pole_pairs_of(const ShuntDcMachineParameters& p) noexcept;
/// Resistance and inductance in series act on the armature; the field sees the source before them.
ShuntDcMachineParameters adjusted(const ShuntDcMachineParameters& p, const Adjustment& a) noexcept;
/// L/R or, saturated, L_f/R_F, whichever is less: sets the substep.
double fastest_time_constant_s(const ShuntDcMachineParameters& p) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct ShuntDcMachine {
  using Parameters = ShuntDcMachineParameters;
  using Constants = ShuntDcMachineConstants;
  using State = ShuntDcMachineState;
  static constexpr bool kUsesAngle = false;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
