#pragma once

#include "plant/axis.hpp"

/// The 1/12 hp servo motor of the book's examples, in the two-phase values of its section 8.2.
namespace drivebench {

inline constexpr InductionMachineParameters kServoMachine{.pole_pairs = 3,
                                                          .stator_resistance_ohm = 1.7,
                                                          .rotor_resistance_ohm = 3.9,
                                                          .stator_inductance_h = 0.014,
                                                          .rotor_inductance_h = 0.014,
                                                          .mutual_inductance_h = 0.0117};
inline constexpr double kServoInertia_kgm2 = 1.1e-4;
inline constexpr double kServoFriction_nms = 1.4e-4;
inline constexpr double kServoTick_s = 125e-6;
inline constexpr AxisTiming kServoTiming{.period_s = kServoTick_s, .substeps = 5};

/// The motor with its viscous friction, a wide amplifier, 2000 counts and ideal sensors.
inline AxisParameters servo_axis() {
  AxisParameters p;
  p.machine = kServoMachine;
  p.mechanics = {.inertia_kgm2 = kServoInertia_kgm2, .viscous_friction_nms = kServoFriction_nms};
  p.drive.amplifier = {.voltage_limit_v = 1000.0, .over_current_a = 1000.0};
  return p;
}

inline InductionMachineParameters& induction(AxisParameters& p) {
  return std::get<InductionMachineParameters>(p.machine);
}

inline InductionMachineState induction_state(const AxisState& state) {
  return {.i_a_a = state.machine[0],
          .i_b_a = state.machine[1],
          .psi_a_wb = state.machine[2],
          .psi_b_wb = state.machine[3]};
}

inline void set_induction_state(AxisState& state, const InductionMachineState& x) {
  state.machine = {x.i_a_a, x.i_b_a, x.psi_a_wb, x.psi_b_wb};
  state.open_terminals = 0;
}

/// An axis that stands at tick 0, moved to this speed and angle.
inline void spin(Axis& axis, double speed_rad_s, double angle_rad = 0.0) {
  AxisState state = axis.state();
  state.shaft.speed_rad_s = speed_rad_s;
  state.shaft.angle_rad = angle_rad;
  state.encoder.count = axis.encoder().count_at(angle_rad, state.turns);
  axis.restore(state);
}

}  // namespace drivebench
