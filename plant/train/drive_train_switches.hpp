#pragma once

#include "plant/drive/phases.hpp"
#include "plant/train/drive_train.hpp"

// Switches and diodes that take a voltage, and the break input of a drive train.
namespace drivebench {

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::watch_switching(const AxisCore& core, const AxisState& state) noexcept {
  piece_.turning_on = 0;
  piece_.floats_alone = piece_.knows_end = false;
  constexpr int kMaxTurnOns = 2;  // the rest of the events are for currents that die
  const bool shorted = state.injected.phase_short != 0.0 || state.injected.neutral_short != 0.0;
  const bool looks = piece_.turn_ons < kMaxTurnOns && !shorted;
  if (looks && piece_.off != 0 && watches_diodes(core)) {
    for (int k = 0; k < terminal_count(core.connection); ++k) {
      const bool diodes = piece_.drive.mode[static_cast<std::size_t>(k)] == TerminalMode::kDiodes;
      if (diodes && (piece_.off & terminal_bit(k)) != 0) piece_.turning_on |= terminal_bit(k);
    }
    piece_.floats_alone =
        core.connection == Connection::kStar && piece_.turning_on != 0 &&
        (piece_.off & ~driven_terminals(core.connection, piece_.drive)) == all_terminals(core.connection);
  }
  piece_.watched = core.breaks && watches_break(core, state);
  piece_.has_switching = piece_.turning_on != 0 || piece_.watched;
}

template <class Machine, class Shaft>
TerminalInput DriveTrain<Machine, Shaft>::input_behind_switches(Connection connection, const State& x,
                                                                const RotorMotion& motion) const noexcept {
  TerminalInput u = piece_.circuit.start;
  const PhaseValues current_a = terminal_currents(connection, winding_currents(c_, x, motion), piece_.off);
  const PhaseValues taken_v = behind_switches(connection, piece_.drive, {}, current_a);
  const WindingVoltages across = winding_voltages(connection, phases_of(taken_v));
  u.voltage_v = {.a = u.voltage_v.a + across.stator_v.a, .b = u.voltage_v.b + across.stator_v.b};
  u.zero_v += across.zero_v;
  return u;
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::step_behind_switches(const AxisCore& core, Whole& x, double duration_s,
                                                      const ShaftBranch& branch,
                                                      double load_nm) const noexcept {
  x = rk4_step(x, duration_s, [&](const Whole& s) noexcept -> Whole {
    return slope(core, s, input_behind_switches(core.connection, s.machine, motion_of(s)), branch, load_nm);
  });
}

template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::before_switches(Connection connection,
                                                        PhaseValues voltage_v) const noexcept {
  const TerminalSet driven = driven_terminals(connection, piece_.drive);
  if ((driven & 1u) != 0) voltage_v.a = piece_.drive.start_v.a;
  if ((driven & 2u) != 0) voltage_v.b = piece_.drive.start_v.b;
  if ((driven & 4u) != 0) voltage_v.c = piece_.drive.start_v.c;
  return voltage_v;
}

/// A current goes nearly linearly within a piece; between the ends of a piece it is taken so for the mean.
template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::take_switch_voltages(Connection connection, const PhaseValues& from_a,
                                                      const PhaseValues& to_a) noexcept {
  TerminalCircuit& circuit = piece_.circuit;
  const PhaseValues ideal_v = before_switches(connection, circuit.start_v);
  const auto half = [](double x, double y) noexcept { return 0.5 * (x + y); };
  circuit.start_v = behind_switches(connection, piece_.drive, ideal_v, from_a);
  circuit.mean_v = behind_switches(connection, piece_.drive, ideal_v, by_terminal(half, from_a, to_a));
  circuit.end_v = behind_switches(connection, piece_.drive, ideal_v, to_a);
}

template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::floating_within(const AxisCore& core, const State& x,
                                                        const RotorMotion& motion) const noexcept {
  if (piece_.floats_alone) return open_terminal_voltages(core.connection, open_v(x, motion), 0.0);
  PhaseValues held_v = piece_.circuit.start_v;
  if (piece_.switch_ohm != 0.0) {
    held_v = behind_switches(core.connection, piece_.drive, before_switches(core.connection, held_v),
                             terminal_currents(core.connection, winding_currents(c_, x, motion), piece_.off));
  }
  return within_piece_v(core, floating_terminals(core), x, motion, held_v);
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::add_switching(const AxisCore& core, const AxisState& state, const State& x,
                                               const RotorMotion& motion, const PhaseValues& terminal_v,
                                               EventValues& values) const noexcept {
  if (piece_.turning_on != 0) {
    const double turns_on_v = piece_.drive.turns_on_at_v();
    ThreePhase v = phases_of(terminal_v);
    double highest_v = -1e300;
    double lowest_v = 1e300;
    for (int k = 0; k < 3; ++k) {
      if ((piece_.turning_on & terminal_bit(k)) == 0) continue;
      highest_v = std::max(highest_v, phase(v, k));
      lowest_v = std::min(lowest_v, phase(v, k));
      if (!piece_.floats_alone) values.add(turns_on_v - std::abs(phase(v, k)));
    }
    if (piece_.floats_alone) values.add(2.0 * turns_on_v - (highest_v - lowest_v));
  }
  if (!piece_.watched) return;
  const double limit_a = core.p.drive.inverter.break_current_a;
  const PhaseValues current_a = currents(core, state, x, motion);
  values.add(limit_a - std::abs(current_a.a));
  values.add(limit_a - std::abs(current_a.b));
  values.add(limit_a - std::abs(current_a.c));
}

template <class Machine, class Shaft>
int DriveTrain<Machine, Shaft>::first_turn_on_event() const noexcept {
  const bool corner = Machine::kHasCorners && piece_.corner != kNoCorner;
  return std::popcount(piece_.circuit.dying) + (corner ? 1 : 0);
}

template <class Machine, class Shaft>
int DriveTrain<Machine, Shaft>::first_break_event() const noexcept {
  return first_turn_on_event() + (piece_.floats_alone ? 1 : std::popcount(piece_.turning_on));
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::note_turn_on(int electrical_event) noexcept {
  piece_.turns_on = 0;
  const int first = first_turn_on_event();
  if (piece_.turning_on == 0 || electrical_event < first || electrical_event >= first_break_event()) return;
  ++piece_.turn_ons;
  if (!piece_.floats_alone) {
    piece_.turns_on = terminal_bit(nth_terminal(piece_.turning_on, electrical_event - first));
    return;
  }
  ThreePhase v = phases_of(piece_.end_v);
  int high = nth_terminal(piece_.turning_on, 0);
  int low = high;
  for (int k = high + 1; k < 3; ++k) {
    if ((piece_.turning_on & terminal_bit(k)) == 0) continue;
    if (phase(v, k) > phase(v, high)) high = k;
    if (phase(v, k) < phase(v, low)) low = k;
  }
  piece_.turns_on = terminal_bit(high) | terminal_bit(low);
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::note_begun(const AxisCore& core, const AxisState& state, const State& x,
                                            const RotorMotion& motion) noexcept {
  piece_.begun = piece_.rising = 0;
  if (piece_.circuit.dying == 0 || state.injected.phase_short != 0.0 || state.injected.neutral_short != 0.0)
    return;
  ThreePhase start_a = phases_of(piece_.current_a);
  for (int k = 0; k < 3; ++k) {
    if ((piece_.circuit.dying & terminal_bit(k)) != 0 && phase(start_a, k) == 0.0)
      piece_.begun |= terminal_bit(k);
  }
  if (piece_.begun == 0) return;
  const TerminalInput u =
      piece_.switch_ohm == 0.0 ? piece_.circuit.start : input_behind_switches(core.connection, x, motion);
  const auto currents_at = [&](const State& at) noexcept {
    return phases_of(currents(core, state, at, motion));
  };
  ThreePhase before_a = currents_at(x);
  ThreePhase after_a = currents_at(advanced(x, core.step_s, derivative(c_, x, motion, u)));
  ThreePhase clamp_v = phases_of(piece_.circuit.start_v);
  for (int k = 0; k < 3; ++k) {
    const double rise_a = phase(after_a, k) - phase(before_a, k);
    if ((piece_.begun & terminal_bit(k)) != 0 && rise_a * phase(clamp_v, k) < 0.0)
      piece_.rising |= terminal_bit(k);
  }
}

template <class Machine, class Shaft>
PhaseValues DriveTrain<Machine, Shaft>::dying_at_start(const PhaseValues& end_a) const noexcept {
  PhaseValues i = piece_.current_a;
  const PhaseValues& clamp_v = piece_.circuit.start_v;
  const auto mirrored = [](double end, double clamp) noexcept { return end * clamp > 0.0 ? -end : 0.0; };
  if ((piece_.rising & 1u) != 0) i.a = mirrored(end_a.a, clamp_v.a);
  if ((piece_.rising & 2u) != 0) i.b = mirrored(end_a.b, clamp_v.b);
  if ((piece_.rising & 4u) != 0) i.c = mirrored(end_a.c, clamp_v.c);
  return i;
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::stop_backward(const AxisCore& core, AxisState& state, State& x,
                                               const RotorMotion& motion) const noexcept {
  ThreePhase clamp_v = phases_of(piece_.circuit.start_v);
  for (int k = 0; k < 3; ++k) {
    if ((piece_.begun & terminal_bit(k)) == 0) continue;
    ThreePhase now_a = phases_of(currents(core, state, x, motion));
    if (phase(now_a, k) * phase(clamp_v, k) <= 0.0) continue;
    state.open_terminals = opened(core.connection, state.open_terminals, k);
    x = restricted(c_, x, motion, open_input(core.connection, state.open_terminals));
  }
}

}  // namespace drivebench
