#pragma once

#include "plant/machines/field_winding.hpp"
#include "plant/windings.hpp"

namespace drivebench {

/// DC machine whose field winding is in series with the armature. A switch can lay a resistor across the
/// field and so weaken it.
struct SeriesDcMachineParameters {
  double armature_resistance_ohm = 0.0;     ///< R
  double armature_inductance_h = 0.0;       ///< L
  double motor_constant = 0.0;              ///< K_m, torque over field flux linkage and armature current [1]
  double field_resistance_ohm = 0.0;        ///< R_f
  double field_inductance_h = 0.0;          ///< L_f; without a saturation curve
  Curve saturation_curve{};                 ///< lambda_f [Wb] over i_f [A], from (0, 0) on, odd
  double field_shunt_resistance_ohm = 0.0;  ///< R_p; 0: there is none
  bool field_shunt = false;                 ///< the switch of R_p is closed
};

struct SeriesDcMachineConstants {
  double resistance_ohm;
  double inductance_h;
  double per_inductance;  ///< 1/L [1/H]
  double motor_constant;  ///< K_m
  double field_resistance_ohm;
  double loop_resistance_ohm;   ///< R + R_f
  double shunt_resistance_ohm;  ///< R_p
  double split_per_s;           ///< (R + R_p)/L; 0 without R_p
  bool shunted;                 ///< the switch is closed
  bool simple;                  ///< neither R_p nor saturation
  FieldWinding field;           ///< in a loop with L while the switch is open
};

/// The constants of a machine whose parameters are free of problems().
SeriesDcMachineConstants constants_of(const SeriesDcMachineParameters& p) noexcept;

/// While the switch is open one current flows through both windings and the linkage tells it: read the
/// currents with series_circuit().
struct SeriesDcMachineState {
  double linkage_wb = 0.0;  ///< L i + lambda_f, of armature and field in series
  double armature_a = 0.0;  ///< i while the switch is closed
};

/// The currents and the field flux as they are, whatever the switch.
struct SeriesCircuit {
  double armature_a;
  double field_a;
  double flux_wb;
};

SeriesCircuit series_circuit(const SeriesDcMachineConstants& c, SeriesDcMachineState x) noexcept;

///   (L i + lambda_f)' = -R i - R_f i_f - K_m lambda_f w + u
/// Switch open: i_f = i, and L i + lambda_f(i) gives i. Switch closed, i - i_f flows through R_p:
///   L i' = -R i - R_p (i - i_f) - K_m lambda_f w + u,     lambda_f = (L i + lambda_f) - L i gives i_f
/// Closing changes neither current. Opening makes one of two currents: the voltage of the opening contact
/// acts on armature and field in opposite directions, so L i + lambda_f stays, and the energy above that of
/// one current with this linkage burns in the arc. The second member of the state then goes to i at the rate
/// (R + R_p)/L; a switch that closes again before finds the rest of the difference, and never more energy
/// than the arc took. With open terminals i = 0: the field current circulates through R_p, or, if the switch
/// opens then as well, dies at that rate. Source: the book, chapter 1, problem 13, and chapter 2,
/// problems 42 and 43. Cold, as are the next two: so derivative() keeps its values in registers, 1.1 instead
/// of 1.3 times the time of its equation alone.
[[gnu::cold]] SeriesDcMachineState full_derivative(const SeriesDcMachineConstants& c, SeriesDcMachineState x,
                                                   double speed_rad_s, double voltage_v) noexcept;

/// The same with open terminals.
[[gnu::cold]] SeriesDcMachineState open_derivative(const SeriesDcMachineConstants& c,
                                                   SeriesDcMachineState x) noexcept;

/// full_derivative(), or what it comes to without R_p and saturation: (L + L_f) i' = -(R + R_f) i -
/// K_m L_f i w + u.
inline SeriesDcMachineState derivative(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                                       const RotorMotion& motion, const TerminalInput& u) noexcept {
  if (u.conduction == Conduction::kNone) return open_derivative(c, x);
  if (!c.simple) return full_derivative(c, x, motion.speed_rad_s, u.voltage_v.a);
  const double current_a = x.linkage_wb * c.field.per_loop_inductance;
  const double flux_wb = x.linkage_wb * c.field.loop_share;
  return {.linkage_wb = u.voltage_v.a - c.loop_resistance_ohm * current_a -
                        c.motor_constant * motion.speed_rad_s * flux_wb,
          .armature_a = 0.0};
}

[[gnu::cold]] double full_torque_nm(const SeriesDcMachineConstants& c, SeriesDcMachineState x) noexcept;

/// Torque on the rotor: K_m lambda_f i. Without R_p it is never negative, whatever the sign of the voltage.
inline double torque_nm(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                        const RotorMotion&) noexcept {
  if (!c.simple) return full_torque_nm(c, x);
  const double current_a = x.linkage_wb * c.field.per_loop_inductance;
  return c.motor_constant * (x.linkage_wb * c.field.loop_share) * current_a;
}

/// The current of armature and terminals, and that of the field.
inline WindingValues winding_currents(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                                      const RotorMotion&) noexcept {
  const SeriesCircuit s = series_circuit(c, x);
  return {.stator = {s.armature_a, 0.0}, .field = s.field_a};
}

/// With open terminals no current in the armature, and none in the field either unless R_p lets it circulate.
SeriesDcMachineState restricted(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                                const RotorMotion& motion, const TerminalInput& u) noexcept;

/// The back-emf K_m lambda_f w, less R_p i_f with the switch closed.
WindingValues open_circuit_voltages(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// lambda_f, on axis a.
TwoPhase rotor_flux_wb(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// L i^2/2 and the energy of the field, the integral of i_f over lambda_f.
double stored_energy_j(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// R i^2 + R_f i_f^2 + R_p (i - i_f)^2.
double losses_w(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                const RotorMotion& motion) noexcept;

Connection connection_of(const SeriesDcMachineParameters& p) noexcept;
/// 0: the equations do not know the angle.
double pole_pairs_of(const SeriesDcMachineParameters& p) noexcept;
SeriesDcMachineParameters adjusted(const SeriesDcMachineParameters& p, const Adjustment& a) noexcept;
/// A lower bound, saturated and with the switch closed if there is one: sets the substep.
double fastest_time_constant_s(const SeriesDcMachineParameters& p) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct SeriesDcMachine {
  using Parameters = SeriesDcMachineParameters;
  using Constants = SeriesDcMachineConstants;
  using State = SeriesDcMachineState;
  static constexpr bool kUsesAngle = false;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
