#pragma once

#include "plant/train/drive_train_events.hpp"
#include "plant/train/drive_train_switches.hpp"
#include "plant/train/drive_train_tap.hpp"
#include "plant/train/drive_train_terminals.hpp"

namespace drivebench {

template <class Machine, class Shaft>
auto DriveTrain<Machine, Shaft>::machine_of(const AxisState& state) noexcept -> State {
  static_assert(std::is_trivially_copyable_v<State> && sizeof(State) <= sizeof(MachineWords));
  std::array<double, sizeof(State) / sizeof(double)> words;
  std::copy_n(state.machine.begin(), words.size(), words.begin());
  return std::bit_cast<State>(words);
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::keep_machine(AxisState& state, const State& x) noexcept {
  const auto words = std::bit_cast<std::array<double, sizeof(State) / sizeof(double)>>(x);
  std::copy(words.begin(), words.end(), state.machine.begin());
}

template <class Machine, class Shaft>
Shaft DriveTrain<Machine, Shaft>::shaft_of(const AxisState& state) noexcept {
  if constexpr (std::is_same_v<Shaft, TwoMassState>) {
    return state.shaft;
  } else {
    return {.speed_rad_s = state.shaft.speed_rad_s, .angle_rad = state.shaft.angle_rad};
  }
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::keep_shaft(AxisState& state, const Shaft& x) noexcept {
  if constexpr (std::is_same_v<Shaft, TwoMassState>) {
    state.shaft = x;
  } else {
    state.shaft.speed_rad_s = x.speed_rad_s;
    state.shaft.angle_rad = x.angle_rad;
  }
}

template <class Machine, class Shaft>
MachineTruth DriveTrain<Machine, Shaft>::truth(const AxisState& state,
                                               const RotorMotion& motion) const noexcept {
  const State x = machine_of(state);
  const RotorMotion now = turned(motion);
  return {.current_a = winding_currents(c_, x, now),
          .torque_nm = torque_nm(c_, x, now),
          .rotor_flux_wb = rotor_flux_wb(c_, x, now)};
}

template <class Machine, class Shaft>
auto DriveTrain<Machine, Shaft>::slope(const AxisCore& core, const Whole& x, const TerminalInput& u,
                                       const ShaftBranch& branch, double load_nm) const noexcept -> Whole {
  const RotorMotion motion = motion_of(x);
  Whole result;
  result.machine = derivative(c_, x.machine, motion, u);
  result.shaft = derivative(core.shaft, x.shaft, torque_nm(c_, x.machine, motion), load_nm, branch);
  return result;
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::step(const AxisCore& core, Whole& x, double duration_s,
                                      const ShaftBranch& branch, double load_nm) const noexcept {
  if (!piece_.circuit.constant) return step_varying(core, x, duration_s, branch, load_nm);
  if (piece_.switch_ohm != 0.0) return step_behind_switches(core, x, duration_s, branch, load_nm);
  x = rk4_step(x, duration_s, [&](const Whole& s) noexcept -> Whole {
    return slope(core, s, piece_.circuit.start, branch, load_nm);
  });
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::step_varying(const AxisCore& core, Whole& x, double duration_s,
                                              const ShaftBranch& branch, double load_nm) const noexcept {
  const TerminalCircuit& circuit = piece_.circuit;
  x = rk4_step(x, duration_s, [&](const Whole& s, StepPoint point) noexcept -> Whole {
    const TerminalInput& u = point == StepPoint::kStart    ? circuit.start
                             : point == StepPoint::kMiddle ? circuit.middle
                                                           : circuit.end;
    return slope(core, s, u, branch, load_nm);
  });
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::finish_piece(AxisCore& core, AxisState& state,
                                              const Passed& passed) noexcept {
  const auto& [start_s, duration_s, from, to, from_motion, to_motion] = passed;
  if (core.follows) {
    const PhaseValues from_a = piece_.current_a;
    piece_.current_a = currents(core, state, to, to_motion);
    if (piece_.switch_ohm != 0.0) take_switch_voltages(core.connection, from_a, piece_.current_a);
    const bool follows_terminals = core.p.sensors.follow_terminals();
    Followed followed{};
    if (follows_terminals) {
      const bool known = piece_.turning_on != 0 && piece_.knows_end;
      followed.last_v =
          known ? piece_.end_v
                : within_piece_v(core, floating_terminals(core), to, to_motion, piece_.circuit.end_v);
    }
    followed.end_v = core.tap != nullptr && keeps_circuit(core, state, followed.last_v)
                         ? followed.last_v
                         : end_voltages(core, state, to, to_motion);
    if (core.p.thermal.enabled) {
      state.heat_j += 0.5 * duration_s * (losses_w(c_, from, from_motion) + losses_w(c_, to, to_motion));
    }
    if (core.tap != nullptr || (core.comparators.enabled() && piece_.off != 0))
      followed.halfway = middle_motion(passed);
    if (follows_terminals) follow_terminals(core, state, passed, followed);
    if (core.tap != nullptr) {
      core.tap->add_currents(phases_of(piece_.current_a));
      add_sums(core, passed, followed.halfway, from_a);
      core.drive.finish(state.drive, start_s, duration_s, piece_.drive, piece_.circuit.mean_v, from_a,
                        piece_.current_a);
    } else {
      follow_piece(core, state, start_s, duration_s, piece_.drive, piece_.circuit,
                   measurable(core, state, from, from_motion, from_a, piece_.circuit.start_v),
                   measurable(core, state, to, to_motion, piece_.current_a, followed.end_v));
    }
  }
  core.record({.start_s = start_s,
               .duration_s = duration_s,
               .start_rad = from_motion.angle_rad,
               .end_rad = to_motion.angle_rad,
               .start_rad_s = from_motion.speed_rad_s,
               .end_rad_s = to_motion.speed_rad_s});
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::run_piece(AxisCore& core, AxisState& state, Whole& x, double start_s,
                                           double end_s, double load_nm) noexcept {
  const bool blocked = state.injected.blocked_rotor != 0.0;
  Freed freed;
  forget_turn_ons();
  for (std::size_t events = 0; start_s < end_s; ++events) {
    if (core.shaft_has_events || blocked) x.shaft = locked(core.shaft, x.shaft, blocked);
    const Whole from = x;
    const RotorMotion from_motion = motion_of(from);
    piece_.current_a = currents(core, state, from.machine, from_motion);
    if (core.breaks && meet_break(core, state, start_s, piece_.current_a)) {
      piece_.stays = false;
      if (core.tap != nullptr) {
        core.tap->events.add({.at_s = start_s, .kind = EventKind::kBreak, .channel = 0, .level = 1});
      }
    }
    if (core.bootstrap.used()) meet_bootstrap(core, state, start_s);
    const double stop_s = piece_stop_s(core, state, start_s, end_s);
    const double duration_s = stop_s - start_s;
    connect_piece(core, state, start_s, duration_s, from.machine, from_motion);
    note_begun(core, state, from.machine, from_motion);
    ShaftBranch branch;
    if (core.shaft_has_events || blocked) {
      branch = branch_of(core.shaft, from.shaft, torque_nm(c_, from.machine, from_motion), load_nm, blocked,
                         false, freed);
    }
    step(core, x, duration_s, branch, load_nm);
    const bool may_cut =
        piece_.circuit.dying != 0 || core.shaft_has_events || Machine::kHasCorners || piece_.has_switching;
    Cut cut;
    const TerminalSet open_before = state.open_terminals;
    if (may_cut && events < kMaxEvents) {
      cut = piece_.has_switching
                ? cut_at_event<true>(core, state, from, x, start_s, duration_s, branch, load_nm)
                : cut_at_event<false>(core, state, from, x, start_s, duration_s, branch, load_nm);
      if (cut.electrical_event >= 0) {
        settle_terminals(core, state, x.machine, motion_of(x), cut.electrical_event);
      }
    }
    const TerminalSet died = state.open_terminals & ~open_before;
    if (piece_.begun != 0) stop_backward(core, state, x.machine, motion_of(x));
    freed = cut.freed;
    const double passed_s = cut.fraction < 1.0 ? cut.fraction * duration_s : duration_s;
    finish_piece(core, state, {start_s, passed_s, from.machine, x.machine, from_motion, motion_of(x)});
    start_s = cut.fraction < 1.0 ? start_s + passed_s : stop_s;
    if (core.tap != nullptr) tell_deaths(core, died, start_s);
    if (piece_.watched && cut.electrical_event >= first_break_event()) pull_break(core, state, start_s);
    note_turn_on(cut.electrical_event);
  }
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::begin_substep(const Shaft& shaft) noexcept {
  if constexpr (Machine::kUsesAngle) {
    constexpr double kNearRad = 0.05;  // rotated() errs by 1e-15 there
    if (std::abs(pole_pairs_ * (shaft.angle_rad - near_rad_)) > kNearRad) look_up_angle(shaft);
  }
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::look_up_angle(const Shaft& shaft) noexcept {
  if constexpr (Machine::kUsesAngle) {
    near_rad_ = shaft.angle_rad;
    near_ = cos_sin(pole_pairs_ * near_rad_);
  }
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::run_smooth(AxisCore& core, Whole& x, double start_s, double end_s,
                                            double load_nm) noexcept {
  const double start_rad = x.shaft.angle_rad;
  const double start_rad_s = x.shaft.speed_rad_s;
  step(core, x, end_s - start_s, ShaftBranch{}, load_nm);
  core.record({.start_s = start_s,
               .duration_s = end_s - start_s,
               .start_rad = start_rad,
               .end_rad = x.shaft.angle_rad,
               .start_rad_s = start_rad_s,
               .end_rad_s = x.shaft.speed_rad_s});
}

template <class Machine, class Shaft>
bool DriveTrain<Machine, Shaft>::goes_on(AxisCore& core, AxisState& state, double start_s,
                                         const Whole& x) noexcept {
  if (piece_.stays)
    return piece_.plain || (!piece_.has_switching && leave_open(core, x.machine, motion_of(x)));
  if (!piece_.plain || !core.drive.only_switches(state.drive)) return false;
  if (!core.drive.switch_terminals(state.drive, start_s, piece_.drive)) return piece_.circuit.dying == 0;
  if (driven_count(core.connection, piece_.drive) != terminal_count(core.connection)) return false;
  piece_.circuit.dying = 0;
  drive_windings(core, piece_.drive.start_v);
  return true;
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::run(AxisCore& core, AxisState& state, double load_nm) noexcept {
  Whole x;
  x.machine = machine_of(state);
  x.shaft = shaft_of(state);
  look_up_angle(x.shaft);
  piece_.plain = piece_.open = piece_.stays = piece_.has_switching = false;
  const bool smooth =
      !Machine::kHasCorners && !core.shaft_has_events && !core.follows && state.injected.blocked_rotor == 0.0;
  for (int n = 0; n < core.timing.substeps; ++n) {
    begin_substep(x.shaft);
    const double end_s = (n + 1) * core.step_s;
    for (double start_s = n * core.step_s; start_s < end_s;) {
      const double stop_s = std::min(end_s, core.drive.next_edge_s(state.drive, start_s));
      if (smooth && goes_on(core, state, start_s, x)) {
        run_smooth(core, x, start_s, stop_s, load_nm);
      } else {
        run_piece(core, state, x, start_s, stop_s, load_nm);
      }
      start_s = stop_s;
    }
    if (piece_.open) continue;
    const RotorMotion motion = motion_of(x);
    keep_open(core, state, x.machine, motion);
    piece_.current_a = currents(core, state, x.machine, motion);
    if (check_over_current(core, state, piece_.current_a)) piece_.stays = false;
  }
  if (piece_.open) {
    keep_open(core, state, x.machine, motion_of(x));
    piece_.current_a = currents(core, state, x.machine, motion_of(x));
  }
  end_run(core, state, x.machine, motion_of(x));
  keep_machine(state, x.machine);
  keep_shaft(state, x.shaft);
}

template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::run_part(AxisCore& core, AxisState& state, double start_s,
                                                 double end_s, double load_nm) noexcept {
  Whole x;
  x.machine = machine_of(state);
  x.shaft = shaft_of(state);
  look_up_angle(x.shaft);
  piece_.plain = piece_.open = piece_.stays = piece_.has_switching = false;
  run_piece(core, state, x, start_s, end_s, load_nm);
  const RotorMotion motion = motion_of(x);
  keep_open(core, state, x.machine, motion);
  piece_.current_a = currents(core, state, x.machine, motion);
  if (core.tap == nullptr) end_run(core, state, x.machine, motion);
  keep_machine(state, x.machine);
  keep_shaft(state, x.shaft);
  return piece_.current_a;
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::end_run(const AxisCore& core, AxisState& state, const State& x,
                                         const RotorMotion& motion) noexcept {
  if (!has_impedance(core.p.drive)) state.voltage_v = end_voltages(core, state, x, motion);
  if (core.connection == Connection::kStar) {
    state.neutral_v = measurable(core, state, x, motion, piece_.current_a, state.voltage_v).neutral_v;
  }
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::open(AxisCore& core, AxisState& state, double start_s, double duration_s,
                                      const RotorMotion& motion, bool is_first) noexcept {
  piece_.from = machine_of(state);
  piece_.stage = piece_.from;
  piece_.plain = piece_.open = piece_.stays = false;
  if (is_first) forget_turn_ons();
  piece_.current_a = currents(core, state, piece_.from, turned(motion));
  connect_piece(core, state, start_s, duration_s, piece_.from, turned(motion));
  note_begun(core, state, piece_.from, turned(motion));
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::stage(int number, double duration_s, const RotorMotion& motion) noexcept {
  const TerminalCircuit& circuit = piece_.circuit;
  const TerminalInput& u = circuit.constant || number == 0 ? circuit.start
                           : number == 3                   ? circuit.end
                                                           : circuit.middle;
  const State slope =
      piece_.switch_ohm == 0.0
          ? derivative(c_, piece_.stage, turned(motion), u)
          : derivative(c_, piece_.stage, turned(motion),
                       input_behind_switches(piece_.connection, piece_.stage, turned(motion)));
  switch (number) {
    case 0:
      piece_.sum = slope;
      piece_.stage = advanced(piece_.from, 0.5 * duration_s, slope);
      return;
    case 1:
      piece_.sum = advanced(piece_.sum, 2.0, slope);
      piece_.stage = advanced(piece_.from, 0.5 * duration_s, slope);
      return;
    case 2:
      piece_.sum = advanced(piece_.sum, 2.0, slope);
      piece_.stage = advanced(piece_.from, duration_s, slope);
      return;
    default:
      piece_.stage = advanced(piece_.from, duration_s / 6.0, advanced(piece_.sum, 1.0, slope));
  }
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::shorten(AxisCore& core, AxisState& state, double start_s, double duration_s,
                                         const RotorMotion& motion) noexcept {
  piece_.stage = piece_.from;
  reconnect_piece(core, state, start_s, duration_s, piece_.from, turned(motion));
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::add_events(const AxisCore& core, const AxisState& state, PieceEnd end,
                                            const RotorMotion& motion, EventValues& values) const noexcept {
  const RotorMotion at = turned(motion);
  const TerminalSet dying = piece_.circuit.dying;
  PhaseValues current_a{};
  if (dying != 0) {
    current_a = currents(core, state, piece_.stage, at);  // where the stages have led
    if (end == PieceEnd::kStart) current_a = dying_at_start(current_a);
  }
  add_electrical(dying, current_a, at, piece_.corner, values);
  if (!piece_.has_switching) return;
  const State& x = end == PieceEnd::kStart ? piece_.from : piece_.stage;
  PhaseValues terminal_v{};
  if (piece_.turning_on != 0)
    terminal_v = end == PieceEnd::kStart ? first_v(core, x, at) : floating_within(core, x, at);
  add_switching(core, state, x, at, terminal_v, values);
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::close(AxisCore& core, AxisState& state, double start_s, double duration_s,
                                       const RotorMotion& from, const RotorMotion& to, int event) noexcept {
  const RotorMotion end = turned(to);
  piece_.knows_end = piece_.turning_on != 0;
  if (piece_.knows_end) piece_.end_v = floating_within(core, piece_.stage, end);
  if (event >= 0) settle_terminals(core, state, piece_.stage, end, event);
  if (piece_.begun != 0) stop_backward(core, state, piece_.stage, end);
  if (piece_.watched && event >= first_break_event()) pull_break(core, state, start_s + duration_s);
  note_turn_on(event);
  keep_open(core, state, piece_.stage, end);
  finish_piece(core, state, {start_s, duration_s, piece_.from, piece_.stage, turned(from), end});
  piece_.current_a = currents(core, state, piece_.stage, end);
  end_run(core, state, piece_.stage, end);
  keep_machine(state, piece_.stage);
}

/// MachineKind::make_train of this kind of machine.
template <class Machine>
std::unique_ptr<Train> make_drive_train(const MachineParameters& machine, bool two_masses) {
  if (two_masses) return std::make_unique<DriveTrain<Machine, TwoMassState>>(machine);
  return std::make_unique<DriveTrain<Machine, ShaftState>>(machine);
}

}  // namespace drivebench
