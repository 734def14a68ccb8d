#include "plant/train/drive_train.hpp"

#include <algorithm>
#include <cmath>

#include "plant/faults.hpp"

namespace drivebench {
namespace {

/// The mean voltage across the source's own impedance over an interval.
double series_drop_v(const SeriesImpedance& z, double duration_s, double from_a, double to_a) noexcept {
  return 0.5 * z.resistance_ohm * (from_a + to_a) + z.inductance_h * (to_a - from_a) / duration_s;
}

PhaseValues behind_source(const SeriesImpedance& z, double duration_s, const PhaseValues& v,
                          const PhaseValues& from_a, const PhaseValues& to_a) noexcept {
  return {.a = v.a - series_drop_v(z, duration_s, from_a.a, to_a.a),
          .b = v.b - series_drop_v(z, duration_s, from_a.b, to_a.b),
          .c = v.c - series_drop_v(z, duration_s, from_a.c, to_a.c),
          .field = v.field};
}

}  // namespace

bool has_impedance(const DriveParameters& p) noexcept {
  return p.kind == DriveKind::kSource &&
         (p.source.resistance_ohm != 0.0 || p.source.inductance_h != 0.0 || has_transformer(p.transformer));
}

double corner_on_the_way(double from, double to) noexcept {
  // A start that rounding has put just before the corner it comes from is taken as being on it.
  constexpr double kOnIt = 1e-9;
  if (to > from) {
    const double next = static_cast<double>(floor_to_integer(from + kOnIt)) + 1.0;
    return to > next ? next : kNoCorner;
  }
  const double next = -static_cast<double>(floor_to_integer(-from + kOnIt)) - 1.0;
  return to < next ? next : kNoCorner;
}

int nth_terminal(TerminalSet set, int n) noexcept {
  for (int k = 0; k < 3; ++k) {
    if ((set >> k & 1u) != 0 && n-- == 0) return k;
  }
  return -1;
}

TerminalSet opened(Connection connection, TerminalSet open, int terminal) noexcept {
  const TerminalSet result = open | TerminalSet{1} << terminal;
  if (connection != Connection::kStar) return result;
  return std::popcount(result) > 1 ? TerminalSet{7} : result;
}

void trip(AxisCore& core, AxisState& state) noexcept {
  state.faults |= kOverCurrent;
  if (!core.p.drive.amplifier.over_current_trip) return;
  state.faults |= kOverCurrentTrip;
  core.drive.switch_off(state.drive);  // for what is left of the tick, too
}

void pull_break(const AxisCore& core, AxisState& state, double now_s) noexcept {
  state.break_input = {.pending = 1, .due_s = now_s + core.p.drive.inverter.break_delay_s};
}

bool meet_break(AxisCore& core, AxisState& state, double now_s, const PhaseValues& current_a) noexcept {
  const double limit_a = core.p.drive.inverter.break_current_a;
  const double largest_a = std::max({std::abs(current_a.a), std::abs(current_a.b), std::abs(current_a.c)});
  if (watches_break(core, state) && largest_a > limit_a) pull_break(core, state, now_s);
  if (state.break_input.opens_s() > now_s) return false;
  state.break_input = {};
  state.faults |= kBreakInput;
  core.drive.switch_off(state.drive);
  return true;
}

void meet_bootstrap(AxisCore& core, AxisState& state, double now_s) noexcept {
  const auto legs = [&] { return core.drive.closed_switches(state.drive, now_s); };
  // A leg that has a supply again may be one that is to be high. One that has lost it needs time.
  while (core.bootstrap.meet(state.bootstrap, now_s, legs()))
    core.drive.starve(state.bootstrap.empty);
  if (state.bootstrap.empty != 0) state.faults |= kBootstrapEmpty;
}

void follow_piece(AxisCore& core, AxisState& state, double start_s, double duration_s,
                  const TerminalDrive& drive, const TerminalCircuit& circuit, const Measurable& from,
                  const Measurable& to) noexcept {
  core.drive.finish(state.drive, start_s, duration_s, drive, circuit.mean_v, from.current_a, to.current_a);
  if (core.shunts.used()) {
    core.shunts.follow(state.shunts, start_s + duration_s, to.current_a, circuit.end_v);
  }
  if (!has_impedance(core.p.drive)) {
    state.voltage_v = to.voltage_v;
    if (core.sensors.follows()) core.sensors.follow(state.sensors, start_s, duration_s, from, to);
    return;
  }
  const SeriesImpedance z = series_impedance(core.p.drive);
  Measurable behind = from;
  behind.voltage_v = behind_source(z, duration_s, from.voltage_v, from.current_a, to.current_a);
  state.voltage_v = behind_source(z, duration_s, to.voltage_v, from.current_a, to.current_a);
  if (!core.sensors.follows()) return;
  Measurable behind_to = to;
  behind_to.voltage_v = state.voltage_v;
  core.sensors.follow(state.sensors, start_s, duration_s, behind, behind_to);
}

}  // namespace drivebench
