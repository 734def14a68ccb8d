#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// A bar that slides on two rails across a magnetic field. It moves along a line: what is called angle,
/// speed, torque and inertia elsewhere is its position [m], speed [m/s], force [N] and mass [kg]; 1 rad is 1
/// m.
struct LinearDcMachineParameters {
  double resistance_ohm = 0.0;  ///< R of the loop
  double inductance_h = 0.0;    ///< L of the loop, which the book neglects
  double flux_density_t = 0.0;  ///< B across the rails
  double bar_length_m = 0.0;    ///< l between the rails
};

struct LinearDcMachineConstants {
  double resistance_ohm;
  double inductance_h;
  double per_inductance;          ///< 1/L [1/H]
  double force_constant_n_per_a;  ///< B l, which is the emf over the speed [V·s/m] as well
};

/// The constants of a machine whose parameters are free of problems().
LinearDcMachineConstants constants_of(const LinearDcMachineParameters& p) noexcept;

struct LinearDcMachineState {
  double i_a_a = 0.0;
};

/// L i' = u - R i - B l v. The book has L = 0; the currents of both differ for some L/R after a change only.
/// The inductance does not grow with the loop. Source: Chiasson 2005, section 1.2.
inline LinearDcMachineState derivative(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                                       const RotorMotion& motion, const TerminalInput& u) noexcept {
  if (u.conduction == Conduction::kNone) return {};
  return {.i_a_a =
              (u.voltage_v.a - c.resistance_ohm * x.i_a_a - c.force_constant_n_per_a * motion.speed_rad_s) *
              c.per_inductance};
}

/// Force on the bar [N]: B l i.
inline double torque_nm(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                        const RotorMotion&) noexcept {
  return c.force_constant_n_per_a * x.i_a_a;
}

inline WindingValues winding_currents(const LinearDcMachineConstants&, const LinearDcMachineState& x,
                                      const RotorMotion&) noexcept {
  return {.stator = {x.i_a_a, 0.0}};
}

/// The state with the part of the current removed that the circuit does not let flow.
LinearDcMachineState restricted(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                                const RotorMotion& motion, const TerminalInput& u) noexcept;

/// The emf B l v.
WindingValues open_circuit_voltages(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                                    const RotorMotion& motion) noexcept;

/// The flux that the bar sweeps over per metre, on axis a: B l [Wb/m].
TwoPhase rotor_flux_wb(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// L i^2/2.
double stored_energy_j(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                       const RotorMotion& motion) noexcept;

/// R i^2.
double losses_w(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                const RotorMotion& motion) noexcept;

Connection connection_of(const LinearDcMachineParameters& p) noexcept;
/// 0: the equations do not know the position.
double pole_pairs_of(const LinearDcMachineParameters& p) noexcept;
LinearDcMachineParameters adjusted(const LinearDcMachineParameters& p, const Adjustment& a) noexcept;
/// L/R: sets the substep.
double fastest_time_constant_s(const LinearDcMachineParameters& p) noexcept;

/// What makes a drive train and a configuration of the equations: see plant/machines/machine_kind.hpp.
struct LinearDcMachine {
  using Parameters = LinearDcMachineParameters;
  using Constants = LinearDcMachineConstants;
  using State = LinearDcMachineState;
  static constexpr bool kUsesAngle = false;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
