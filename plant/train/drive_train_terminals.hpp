#pragma once

#include "plant/drive/phases.hpp"
#include "plant/train/drive_train.hpp"

// The terminals of a drive train.
namespace drivebench {

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::drive_windings(const AxisCore& core, const ThreePhase& v) noexcept {
  const WindingVoltages u = winding_voltages(core.connection, v);
  piece_.circuit.start.voltage_v = u.stator_v;
  piece_.circuit.start.zero_v = u.zero_v;
  piece_.circuit.start_v = {.a = v.a, .b = v.b, .c = v.c, .field = piece_.drive.field_v};
  if (!core.follows) return;
  piece_.circuit.mean_v = piece_.circuit.start_v;
  piece_.circuit.end_v = piece_.circuit.start_v;
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::hold_constant(const TerminalInput& input) noexcept {
  piece_.circuit.start = input;
  piece_.circuit.constant = true;
  piece_.circuit.dying = 0;
  piece_.circuit.short_circuit = false;
}

template <class Machine, class Shaft>
bool DriveTrain<Machine, Shaft>::conduct(const AxisCore& core, const AxisState& state) noexcept {
  ThreePhase terminal_v;
  TerminalSet dying;
  if (!all_conduct(core.connection, piece_.drive, state.open_terminals, piece_.current_a, terminal_v, dying))
    return false;
  piece_.circuit.dying = dying;
  drive_windings(core, terminal_v);
  return true;
}

template <class Machine, class Shaft>
WindingValues DriveTrain<Machine, Shaft>::floating_v(const State& x, const RotorMotion& motion,
                                                     const TerminalInput& u) const noexcept {
  if constexpr (requires { floating_voltages(c_, x, motion, u); }) {
    return floating_voltages(c_, x, motion, u);
  } else {
    return open_circuit_voltages(c_, x, motion);
  }
}

template <class Machine, class Shaft>
WindingValues DriveTrain<Machine, Shaft>::open_v(const State& x, const RotorMotion& motion) const noexcept {
  if constexpr (requires { open_circuit_voltages(c_, x, motion, piece_.drive.field_v); }) {
    return open_circuit_voltages(c_, x, motion, piece_.drive.field_v);
  } else {
    return open_circuit_voltages(c_, x, motion);
  }
}

template <class Machine, class Shaft>
bool DriveTrain<Machine, Shaft>::leave_open(const AxisCore& core, const State& x,
                                            const RotorMotion& motion) noexcept {
  const WindingValues emf_v = open_v(x, motion);
  // No phase has more than the sum of the components.
  const double most_v = std::abs(emf_v.stator.a) + std::abs(emf_v.stator.b) + std::abs(emf_v.zero);
  const bool may_conduct = most_v > piece_.drive.rail_v || piece_.drive.turns_on != 0;
  if (may_conduct && !diodes_block(core.connection, piece_.drive, emf_v)) return false;
  if (core.follows) {
    piece_.circuit.start_v = open_terminal_voltages(core.connection, emf_v, piece_.drive.field_v);
    piece_.circuit.mean_v = piece_.circuit.start_v;
  }
  return true;
}

template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::end_voltages(const AxisCore& core, const AxisState& state,
                                                     const State& x,
                                                     const RotorMotion& motion) const noexcept {
  if (piece_.plain) return piece_.switch_ohm != 0.0 ? piece_.circuit.end_v : piece_.circuit.start_v;
  if (state.open_terminals == 0) return piece_.circuit.end_v;
  if (piece_.open) {
    return open_terminal_voltages(core.connection, open_v(x, motion), piece_.drive.field_v);
  }
  TerminalDrive drive = piece_.drive;
  drive.turns_on = 0;
  if (!drive.constant) drive.start_v = drive.end_v;
  const auto ask = [&](const TerminalInput& u) noexcept { return floating_v(x, motion, u); };
  return connected_voltages(core.connection, drive, state.injected, piece_.current_a, WindingVoltagesOf(ask),
                            state.open_terminals);
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::connect_piece(AxisCore& core, AxisState& state, double start_s,
                                               double duration_s, const State& x,
                                               const RotorMotion& motion) noexcept {
  if (piece_.stays && !piece_.has_switching && (piece_.plain || leave_open(core, x, motion))) return;
  if (piece_.plain && core.drive.only_switches(state.drive)) {
    core.drive.switch_terminals(state.drive, start_s, piece_.drive);
    if (conduct(core, state)) {
      if (core.breaks) watch_switching(core, state);
      return;
    }
  }
  piece_.drive = core.drive.at(state.drive, start_s, duration_s, piece_.current_a);
  piece_.drive.turns_on = piece_.turns_on;
  const TerminalSet all = all_terminals(core.connection);
  const bool sound =
      piece_.drive.constant && state.injected.phase_short == 0.0 && state.injected.neutral_short == 0.0;
  if (sound) hold_constant({.field_v = piece_.drive.field_v});
  piece_.plain = sound && conduct(core, state);
  piece_.open = sound && (state.open_terminals & all) == all &&
                driven_count(core.connection, piece_.drive) == 0 && leave_open(core, x, motion);
  piece_.stays =
      (piece_.open || (piece_.plain && piece_.circuit.dying == 0)) && core.drive.steady(state.drive);
  if (piece_.plain) {
    state.open_terminals = 0;
    piece_.off = 0;
  } else if (piece_.open) {
    TerminalInput none = open_input(core.connection, all);
    none.field_v = piece_.drive.field_v;
    hold_constant(none);
    state.open_terminals = all;
    piece_.off = all;
  } else {
    const auto ask = [&](const TerminalInput& u) noexcept { return floating_v(x, motion, u); };
    piece_.circuit = connect(core.connection, piece_.drive, state.injected, piece_.current_a,
                             WindingVoltagesOf(ask), state.open_terminals);
    if (piece_.circuit.short_circuit) trip(core, state);
    piece_.off = state.open_terminals;
  }
  piece_.switch_ohm = sound ? piece_.drive.switch_ohm : 0.0;
  piece_.connection = core.connection;
  if (core.breaks || (piece_.off != 0 && watches_diodes(core))) {
    watch_switching(core, state);
  } else {
    piece_.turning_on = 0;
    piece_.floats_alone = piece_.has_switching = piece_.watched = false;
  }
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::reconnect_piece(AxisCore& core, AxisState& state, double start_s,
                                                 double duration_s, const State& x,
                                                 const RotorMotion& motion) noexcept {
  if (piece_.circuit.constant && !piece_.drive.link_moves) return;
  const Piece whole = piece_;
  const TerminalSet open = state.open_terminals;
  connect_piece(core, state, start_s, duration_s, x, motion);
  const bool same_events = piece_.circuit.dying == whole.circuit.dying && piece_.off == whole.off &&
                           piece_.turning_on == whole.turning_on;
  if (same_events) return;
  piece_ = whole;
  state.open_terminals = open;
}

template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::within_piece_v(const AxisCore& core, TerminalSet floating,
                                                       const State& x, const RotorMotion& motion,
                                                       const PhaseValues& driven_v) const noexcept {
  if (floating == 0) return driven_v;
  if (piece_.switch_ohm != 0.0 && !piece_.open) {
    return with_floating(core.connection, floating, driven_v,
                         floating_v(x, motion, input_behind_switches(core.connection, x, motion)));
  }
  const TerminalInput& u = piece_.circuit.constant ? piece_.circuit.start : piece_.circuit.end;
  return with_floating(core.connection, floating, driven_v,
                       piece_.open ? open_v(x, motion) : floating_v(x, motion, u));
}

template <class Machine, class Shaft>
bool DriveTrain<Machine, Shaft>::keeps_circuit(const AxisCore& core, const AxisState& state,
                                               const PhaseValues& last_v) const noexcept {
  const bool sound = state.injected.phase_short == 0.0 && state.injected.neutral_short == 0.0;
  if (!piece_.circuit.constant || !sound || state.open_terminals != piece_.off) return false;
  if (core.connection == Connection::kStar && std::popcount(piece_.off) > 1) return false;
  const ThreePhase v = phases_of(last_v);
  const auto blocks = [&](int k, double terminal_v) noexcept {
    return (piece_.off & terminal_bit(k)) == 0 ||
           std::abs(terminal_v) <= piece_.drive.conducts_above_v(terminal_bit(k));
  };
  return blocks(0, v.a) && blocks(1, v.b) && blocks(2, v.c);
}

template <class Machine, class Shaft>
auto DriveTrain<Machine, Shaft>::middle_of(const Passed& passed) const noexcept -> State {
  return advanced(passed.from, 0.5, advanced(passed.to, -1.0, passed.from));
}

/// Of the cubic with the angles and speeds at both ends.
template <class Machine, class Shaft>
RotorMotion DriveTrain<Machine, Shaft>::middle_motion(const Passed& passed) const noexcept {
  const RotorMotion& from = passed.from_motion;
  const RotorMotion& to = passed.to_motion;
  RotorMotion middle{.angle_rad = 0.5 * (from.angle_rad + to.angle_rad) +
                                  0.125 * passed.duration_s * (from.speed_rad_s - to.speed_rad_s),
                     .speed_rad_s = 0.5 * (from.speed_rad_s + to.speed_rad_s),
                     .electrical = from.electrical};
  if constexpr (Machine::kUsesAngle)
    middle.electrical = rotated(from.electrical, pole_pairs_ * (middle.angle_rad - from.angle_rad));
  return middle;
}

/// Of the terminals that do not float; mean_v is by Simpson's rule.
template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::middle_v() const noexcept {
  const TerminalCircuit& circuit = piece_.circuit;
  if (circuit.constant) return piece_.switch_ohm != 0.0 ? circuit.mean_v : circuit.start_v;
  const auto middle = [](double start, double mean, double end) noexcept {
    return 0.25 * (6.0 * mean - start - end);
  };
  return by_terminal(middle, circuit.start_v, circuit.mean_v, circuit.end_v);
}

/// In the means a floating terminal goes linearly between the ends of a piece, at most a substep apart; for
/// comparators along the parabola through its middle.
template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::follow_terminals(const AxisCore& core, AxisState& state,
                                                  const Passed& passed,
                                                  const Followed& followed) const noexcept {
  const TerminalSet floating = floating_terminals(core);
  const double rail_v = piece_.drive.rail_v;
  const auto above = [&](double v) noexcept { return above_negative_rail(core.connection, v, rail_v); };
  const auto against_rail = [&](const ThreePhase& v, TerminalSet afloat) noexcept {
    const ThreePhase result = existing(by_phase(above, v), terminal_count(core.connection));
    const bool open_star = core.connection == Connection::kStar && afloat == all_terminals(core.connection);
    return open_star ? within_rails(result, 2.0 * rail_v, piece_.drive.diode_v) : result;
  };
  const PhaseValues& first_v = piece_.circuit.start_v;
  const PhaseValues& last_v = followed.last_v;
  if (core.p.sensors.terminals && core.tap == nullptr) {
    ThreePhase mean_v = phases_of(piece_.circuit.mean_v);
    if ((floating & 1u) != 0) mean_v.a = 0.5 * (first_v.a + last_v.a);
    if ((floating & 2u) != 0) mean_v.b = 0.5 * (first_v.b + last_v.b);
    if ((floating & 4u) != 0) mean_v.c = 0.5 * (first_v.c + last_v.c);
    const double part = passed.duration_s / core.timing.period_s;
    const auto add = [part](double sum, double v) noexcept { return sum + part * v; };
    state.terminal_mean_v = by_phase(add, state.terminal_mean_v, against_rail(mean_v, floating));
  }
  if (core.p.sensors.terminals) {
    const TerminalSet floats = state.open_terminals & ~driven_terminals(core.connection, piece_.drive);
    state.terminal_v = against_rail(phases_of(followed.end_v), floats);
    if (const double rise_v = piece_.drive.link_rise_v; rise_v != 0.0) {
      state.terminal_v =
          by_phase([=](double v, double part) { return v + part * rise_v; }, state.terminal_v,
                   parts_of_link(core.connection, phases_of(before_switches(core.connection, followed.end_v)),
                                 floats));
    }
  }
  if (!core.comparators.enabled() && core.tap == nullptr) return;
  const PhaseValues half_v =
      floating == 0 ? middle_v()
                    : within_piece_v(core, floating, middle_of(passed), followed.halfway, middle_v());
  const TerminalPath path{.start_v = against_rail(phases_of(first_v), floating),
                          .middle_v = against_rail(phases_of(half_v), floating),
                          .end_v = against_rail(phases_of(last_v), floating),
                          .link_v = above(rail_v)};
  EventLog* log = nullptr;
  if (core.tap != nullptr) {
    log = &core.tap->events;
    const double sixth_s = passed.duration_s / 6.0;
    const auto add = [sixth_s](double sum, double start, double middle, double end) noexcept {
      return sum + sixth_s * (start + 4.0 * middle + end);
    };
    ThreePhase& sum_vs = core.tap->sums.terminal_vs;
    sum_vs = by_phase(add, sum_vs, path.start_v, path.middle_v, path.end_v);
  }
  if (!core.comparators.enabled()) return;
  core.comparators.follow(state.comparators, core.tick, passed.start_s, passed.duration_s, path, log);
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::settle_terminals(const AxisCore& core, AxisState& state, State& x,
                                                  const RotorMotion& motion,
                                                  int electrical_event) const noexcept {
  const int terminal = nth_terminal(piece_.circuit.dying, electrical_event);
  if (terminal < 0) return;  // a corner
  state.open_terminals = opened(core.connection, state.open_terminals, terminal);
  x = restricted(c_, x, motion, open_input(core.connection, state.open_terminals));
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::keep_open(const AxisCore& core, const AxisState& state, State& x,
                                           const RotorMotion& motion) const noexcept {
  if (state.open_terminals == 0) return;
  x = restricted(c_, x, motion,
                 piece_.open ? piece_.circuit.start : open_input(core.connection, state.open_terminals));
}

template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::currents(const AxisCore& core, const AxisState& state, const State& x,
                                                 const RotorMotion& motion) const noexcept {
  return terminal_currents(core.connection, winding_currents(c_, x, motion), state.open_terminals);
}

template <class Machine, class Shaft>
Measurable DriveTrain<Machine, Shaft>::measurable(const AxisCore& core, const AxisState& state,
                                                  const State& x, const RotorMotion& motion,
                                                  const PhaseValues& current_a,
                                                  const PhaseValues& voltage_v) const noexcept {
  Measurable m{.current_a = current_a,
               .voltage_v = voltage_v,
               .bus_v = state.drive.bus_v,
               .temperature_k = state.thermal.temperature_k,
               .angle_rad = motion.angle_rad,
               .speed_rad_s = motion.speed_rad_s};
  if (core.connection == Connection::kStar) {
    m.neutral_v = (voltage_v.a + voltage_v.b + voltage_v.c) / 3.0;
    if constexpr (requires { neutral_voltage_v(c_, x, motion, 0.0); }) {
      m.neutral_v = neutral_voltage_v(c_, x, motion, m.neutral_v);
    }
  }
  return m;
}

}  // namespace drivebench
