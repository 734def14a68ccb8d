#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <vector>

#include "plant/axis.hpp"
#include "tests/plant/drive_rig.hpp"

/// A small motor in a star on a switched inverter that holds still, for closed forms of R and L.
namespace drivebench::bridge_rig {

inline constexpr double kLink_v = 24.0;
inline constexpr double kResistance_ohm = 0.1;
inline constexpr double kInductance_h = 40e-6;
inline constexpr double kTime_s = kInductance_h / kResistance_ohm;
inline constexpr double kTick_s = 50e-6;
inline constexpr AxisTiming kTiming{.period_s = kTick_s, .substeps = 16};

inline AxisParameters standing_motor() {
  AxisParameters p;
  p.machine = PmMachineParameters{.pole_pairs = 7,
                                  .stator_resistance_ohm = kResistance_ohm,
                                  .inductance_d_h = kInductance_h,
                                  .inductance_q_h = kInductance_h,
                                  .torque_constant_nm_per_a = 0.0129,
                                  .star = true};
  p.mechanics = {.inertia_kgm2 = 1e9};
  p.drive = plain_drive(DriveKind::kSwitched);
  p.drive.amplifier.voltage_limit_v = 0.5 * kLink_v;
  p.drive.amplifier.over_current_a = 1000.0;
  p.drive.bus.voltage_v = kLink_v;
  p.sensors.terminals = true;
  return p;
}

inline const PmMachineParameters& pm(const AxisParameters& p) {
  return std::get<PmMachineParameters>(p.machine);
}

/// From a to b; c carries nothing.
inline void set_line_current(Axis& axis, double current_a) {
  AxisState state = axis.state();
  const TwoPhase i = three_to_two({current_a, -current_a, 0.0});
  state.machine = {i.a, i.b};
  state.open_terminals = terminal_bit(2);
  axis.restore(state);
}

inline LegEdgeList list(std::initializer_list<LegEdge> edges) {
  LegEdgeList result{};
  std::copy(edges.begin(), edges.end(), result.begin());
  return result;
}

inline PhaseCommand legs(const LegEdgeList& a, const LegEdgeList& b, const LegEdgeList& c = {}) {
  return {.gates = Gates::kEdges, .edges = {a, b, c}};
}

/// The ends of the pieces of the last tick that are no ends of substeps, from its start.
inline std::vector<double> events(const Axis& axis) {
  std::vector<double> result;
  for (const AngleSegment& piece : axis.last_tick()) {
    const double end_s = piece.start_s + piece.duration_s;
    const double substeps = end_s / axis.timing().period_s * axis.timing().substeps;
    if (std::abs(substeps - std::round(substeps)) > 1e-6) result.push_back(end_s);
  }
  return result;
}

inline std::array<double, 3> currents(const Axis& axis) {
  const Sample s = axis.sample(0);
  return {s.true_i_a_a, s.true_i_b_a, s.true_i_c_a};
}

}  // namespace drivebench::bridge_rig
