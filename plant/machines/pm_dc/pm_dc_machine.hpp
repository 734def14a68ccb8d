#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// Brushed DC machine with permanent magnets; the armature is winding a.
struct PmDcMachineParameters {
  double armature_resistance_ohm = 0.0;   ///< R, brushes included
  double armature_inductance_h = 0.0;     ///< L
  double torque_constant_nm_per_a = 0.0;  ///< K_T, which is K_b [V·s/rad] as well
};

struct PmDcMachineConstants {
  double resistance_ohm;
  double inductance_h;
  double per_inductance;  ///< 1/L [1/H]
  double torque_constant_nm_per_a;
};

/// The constants of a machine whose parameters are free of problems().
PmDcMachineConstants constants_of(const PmDcMachineParameters& p) noexcept;

struct PmDcMachineState {
  double i_a_a = 0.0;
};

/// L i' = -R i - K w + u, with K_b = K_T = K: the power K w i that leaves the circuit is the torque times the
/// speed. Motor convention. Omitted: the ripple of commutation, armature reaction, brush drop.
/// Source: the book, (1.6), (1.12), (2.1).
inline PmDcMachineState derivative(const PmDcMachineConstants& c, const PmDcMachineState& x,
                                   const RotorMotion& motion, const TerminalInput& u) noexcept {
  if (u.conduction == Conduction::kNone) return {};
  return {.i_a_a =
              (u.voltage_v.a - c.resistance_ohm * x.i_a_a - c.torque_constant_nm_per_a * motion.speed_rad_s) *
              c.per_inductance};
}

/// Torque on the rotor: K i.
inline double torque_nm(const PmDcMachineConstants& c, const PmDcMachineState& x,
                        const RotorMotion&) noexcept {
  return c.torque_constant_nm_per_a * x.i_a_a;
}

inline WindingValues winding_currents(const PmDcMachineConstants&, const PmDcMachineState& x,
                                      const RotorMotion&) noexcept {
  return {.stator = {x.i_a_a, 0.0}};
}

/// The state with the part of the armature current removed that the circuit does not let flow.
PmDcMachineState restricted(const PmDcMachineConstants& c, const PmDcMachineState& x,
                            const RotorMotion& motion, const TerminalInput& u) noexcept;

/// The back-emf K w.
WindingValues open_circuit_voltages(const PmDcMachineConstants& c, const PmDcMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// The flux linkage of the magnets at the brushes, on axis a: K.
TwoPhase rotor_flux_wb(const PmDcMachineConstants& c, const PmDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// L i^2/2.
double stored_energy_j(const PmDcMachineConstants& c, const PmDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// R i^2.
double losses_w(const PmDcMachineConstants& c, const PmDcMachineState& x, const RotorMotion& motion) noexcept;

Connection connection_of(const PmDcMachineParameters& p) noexcept;
/// 0: the equations do not know the angle.
double pole_pairs_of(const PmDcMachineParameters& p) noexcept;
PmDcMachineParameters adjusted(const PmDcMachineParameters& p, const Adjustment& a) noexcept;
/// L/R: sets the substep.
double fastest_time_constant_s(const PmDcMachineParameters& p) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct PmDcMachine {
  using Parameters = PmDcMachineParameters;
  using Constants = PmDcMachineConstants;
  using State = PmDcMachineState;
  static constexpr bool kUsesAngle = false;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
