#include "plant/drive/terminals.hpp"

#include <algorithm>
#include <cmath>

#include "plant/drive/phases.hpp"

namespace drivebench {
namespace {

using Phases = std::array<double, 3>;

constexpr std::size_t at(int k) noexcept {
  return static_cast<std::size_t>(k);
}

Phases phases(const ThreePhase& x) noexcept {
  return {x.a, x.b, x.c};
}

ThreePhase values(const Phases& x) noexcept {
  return {.a = x[0], .b = x[1], .c = x[2]};
}

Phases winding_phases(Connection connection, const WindingValues& x) noexcept {
  if (connection == Connection::kTwoPhase || connection == Connection::kArmature) {
    return {x.stator.a, x.stator.b, 0.0};
  }
  const ThreePhase plane = two_to_three(x.stator);
  const double zero = frames_detail::kRootThird * x.zero;
  return {plane.a + zero, plane.b + zero, plane.c + zero};
}

/// The values of each terminal that are computed before those of the windings.
struct Work {
  Connection connection;
  const TerminalDrive& drive;
  Phases current_a;
  WindingVoltagesOf ask;
  Phases voltage_v{};
  TerminalSet open = 0;
  TerminalSet dying = 0;
  int count = 0;

  bool driven(int k) const noexcept { return drive.mode[at(k)] == TerminalMode::kDriven; }
  bool has_diodes(int k) const noexcept { return drive.mode[at(k)] == TerminalMode::kDiodes; }
  bool conducts(int k) const noexcept { return (open & terminal_bit(k)) == 0; }
};

/// Sorts the terminals into driven, dying and open ones by mode and current.
void sort_terminals(Work& w) noexcept {
  const Phases start = phases(w.drive.start_v);
  for (int k = 0; k < w.count; ++k) {
    if (w.driven(k)) {
      w.open &= ~terminal_bit(k);
      w.voltage_v[at(k)] = start[at(k)];
      if (w.drive.switch_ohm != 0.0) w.voltage_v[at(k)] -= w.drive.switch_ohm * w.current_a[at(k)];
    } else if (w.conducts(k) && w.current_a[at(k)] != 0.0) {
      w.dying |= terminal_bit(k);
      w.voltage_v[at(k)] = terminals_detail::against(w.current_a[at(k)], w.drive.clamp_v());
    } else {
      w.open |= terminal_bit(k);
    }
  }
}

/// A diode begins to conduct: the terminal goes to the rail on this side, and beyond it by its voltage.
void clamp_terminal(Work& w, int k, double side) noexcept {
  w.open &= ~terminal_bit(k);
  w.dying |= terminal_bit(k);
  w.voltage_v[at(k)] = side * w.drive.clamp_v();
}

int conducting_count(const Work& w) noexcept {
  return (w.conducts(0) ? 1 : 0) + (w.conducts(1) ? 1 : 0) + (w.conducts(2) ? 1 : 0);
}

/// The input of the windings from the part of the circuit that is decided so far.
TerminalInput circuit_input(const Work& w, const Phases& v) noexcept {
  TerminalInput u = open_input(w.connection, w.open);
  const WindingVoltages across = winding_voltages(w.connection, values(v));
  u.voltage_v = across.stator_v;
  u.zero_v = across.zero_v;
  u.field_v = w.drive.field_v;
  return u;
}

/// Neutral of a star from the terminals that conduct: each is at its winding's voltage above it.
double neutral_from_conducting(const Work& w, const Phases& winding_v) noexcept {
  double sum_v = 0.0;
  for (int k = 0; k < 3; ++k) {
    if (w.conducts(k)) sum_v += w.voltage_v[at(k)] - winding_v[at(k)];
  }
  const int conducting = conducting_count(w);
  return conducting > 0 ? sum_v / conducting : 0.0;
}

/// No terminal of a star conducts: two diodes do if the voltage between their terminals is beyond the whole
/// link.
bool start_rectifier(Work& w, const Phases& winding_v) noexcept {
  int high = -1;
  int low = -1;
  for (int k = 0; k < 3; ++k) {
    if (!w.has_diodes(k)) continue;
    if (high < 0 || winding_v[at(k)] > winding_v[at(high)]) high = k;
    if (low < 0 || winding_v[at(k)] < winding_v[at(low)]) low = k;
  }
  if (high < 0 || high == low ||
      winding_v[at(high)] - winding_v[at(low)] <= 2.0 * w.drive.conducts_above_v(all_terminals(w.connection)))
    return false;
  clamp_terminal(w, high, 1.0);
  clamp_terminal(w, low, -1.0);
  return true;
}

/// Puts the open terminals where the machine has them, and lets the first diode conduct beyond whose rail
/// that is. Whether there was one: the others must be asked again then.
bool float_once(Work& w) noexcept {
  const bool star = w.connection == Connection::kStar;
  const Phases winding_v = winding_phases(w.connection, w.ask(circuit_input(w, w.voltage_v)));
  const bool alone = star && conducting_count(w) == 0;
  if (alone && start_rectifier(w, winding_v)) return true;
  const double neutral_v = star ? neutral_from_conducting(w, winding_v) : 0.0;
  for (int k = 0; k < w.count; ++k) {
    if (w.conducts(k)) continue;
    const double floating_v = neutral_v + winding_v[at(k)];
    w.voltage_v[at(k)] = floating_v;
    if (!w.has_diodes(k) || alone || std::abs(floating_v) <= w.drive.conducts_above_v(terminal_bit(k)))
      continue;
    clamp_terminal(w, k, floating_v > 0.0 ? 1.0 : -1.0);
    return true;
  }
  return false;
}

void float_terminals(Work& w) noexcept {
  // Each pass lets at least one more terminal conduct.
  for (int pass = 0; pass < 3 && (w.open & all_terminals(w.connection)) != 0; ++pass) {
    if (!float_once(w)) break;
  }
  // One terminal of a star alone carries nothing.
  if (w.connection == Connection::kStar && conducting_count(w) == 1) {
    w.open = all_terminals(w.connection);
    w.dying = 0;
  }
}

PhaseValues simpson_mean(const PhaseValues& start, const PhaseValues& middle,
                         const PhaseValues& end) noexcept {
  const auto mean = [](double x, double y, double z) noexcept { return (x + 4.0 * y + z) / 6.0; };
  return {.a = mean(start.a, middle.a, end.a),
          .b = mean(start.b, middle.b, end.b),
          .c = mean(start.c, middle.c, end.c),
          .field = mean(start.field, middle.field, end.field)};
}

/// A short between two terminals puts both at the mean of what holds them.
bool short_terminals(Phases& v, int p, int q) noexcept {
  const double mean_v = 0.5 * (v[at(p)] + v[at(q)]);
  const bool differs = v[at(p)] != v[at(q)];
  v[at(p)] = mean_v;
  v[at(q)] = mean_v;
  return differs;
}

/// A shorted winding: none of the terminal voltage is left for it.
void short_winding(Connection connection, Phases& v, int k) noexcept {
  v[at(k)] = connection == Connection::kStar ? 0.5 * (v[at((k + 1) % 3)] + v[at((k + 2) % 3)]) : 0.0;
}

struct Shorts {
  int pair = -1;     ///< first terminal of a shorted pair (k, k + 1); -1: none
  int winding = -1;  ///< shorted winding; -1: none
};

Shorts shorts_of(const InjectedFaults& faults, int count) noexcept {
  Shorts result{.pair = static_cast<int>(faults.phase_short) - 1,
                .winding = static_cast<int>(faults.neutral_short) - 1};
  if (count < 2 || (count == 2 && result.pair > 0)) result.pair = -1;
  if (result.winding >= count) result.winding = -1;
  return result;
}

/// With a short the windings that it joins always conduct.
void close_shorted(Work& w, const Shorts& shorts) noexcept {
  if (shorts.pair >= 0) {
    const int next = w.count == 2 ? 1 : (shorts.pair + 1) % 3;
    w.open &= ~(terminal_bit(shorts.pair) | terminal_bit(next));
  }
  if (shorts.winding >= 0) w.open &= ~terminal_bit(shorts.winding);
}

bool apply_shorts(const Work& w, const Shorts& shorts, Phases& v) noexcept {
  bool short_circuit = false;
  if (shorts.pair >= 0) {
    const int next = w.count == 2 ? 1 : (shorts.pair + 1) % 3;
    short_circuit = short_terminals(v, shorts.pair, next) && w.driven(shorts.pair) && w.driven(next);
  }
  if (shorts.winding >= 0) {
    short_circuit = short_circuit || (w.driven(shorts.winding) && v[at(shorts.winding)] != 0.0);
    short_winding(w.connection, v, shorts.winding);
  }
  return short_circuit;
}

Work work_of(Connection connection, const TerminalDrive& drive, const PhaseValues& current_a,
             WindingVoltagesOf winding_v, TerminalSet open) noexcept {
  return {.connection = connection,
          .drive = drive,
          .current_a = {current_a.a, current_a.b, current_a.c},
          .ask = winding_v,
          .open = open & all_terminals(connection),
          .count = terminal_count(connection)};
}

/// Decides which terminals conduct.
void decide(Work& w, const Shorts& shorts) noexcept {
  sort_terminals(w);
  close_shorted(w, shorts);
  float_terminals(w);
  close_shorted(w, shorts);
}

/// The voltages of the terminals where the driven ones are at driven_v.
Phases terminals_at(const Work& w, const Shorts& shorts, const ThreePhase& driven_v,
                    bool& short_circuit) noexcept {
  Phases v = w.voltage_v;
  const Phases wanted = phases(driven_v);
  for (int k = 0; k < w.count; ++k) {
    if (w.driven(k)) v[at(k)] = wanted[at(k)];
  }
  short_circuit = apply_shorts(w, shorts, v) || short_circuit;
  return v;
}

}  // namespace

TerminalInput open_input(Connection connection, TerminalSet open) noexcept {
  TerminalInput u;
  open &= all_terminals(connection);
  if (open == 0) return u;
  if (connection == Connection::kIndependent) {
    u.conducts = {.a = (open & 1u) != 0 ? 0.0 : 1.0,
                  .b = (open & 2u) != 0 ? 0.0 : 1.0,
                  .c = (open & 4u) != 0 ? 0.0 : 1.0};
    return u;
  }
  if (connection != Connection::kStar) {
    u.conduction = open == all_terminals(connection) ? Conduction::kNone : Conduction::kLine;
    u.line = {.a = (open & 1u) != 0 ? 0.0 : 1.0, .b = (open & 2u) != 0 ? 0.0 : 1.0};
    return u;
  }
  // Current flows between the two terminals that are left: b - c, c - a or a - b in the plane.
  constexpr double kRootThreeHalves = 0x1.bb67ae8584caap-1;  // sqrt(3)/2
  u.conduction = Conduction::kLine;
  if (open == 1u) {
    u.line = {.a = 0.0, .b = 1.0};
  } else if (open == 2u) {
    u.line = {.a = -kRootThreeHalves, .b = -0.5};
  } else if (open == 4u) {
    u.line = {.a = kRootThreeHalves, .b = -0.5};
  } else {
    u.conduction = Conduction::kNone;
  }
  return u;
}

PhaseValues open_terminal_voltages(Connection connection, const WindingValues& open_circuit_v,
                                   double field_v) noexcept {
  const Phases v = winding_phases(connection, open_circuit_v);
  return {.a = v[0], .b = v[1], .c = v[2], .field = field_v};
}

ThreePhase parts_of_link(Connection connection, const ThreePhase& terminal_v, TerminalSet floating) noexcept {
  constexpr double kMiddle = 0.5;  // between the rails
  const auto part = [](double v) noexcept { return v > 0.0 ? 1.0 : v < 0.0 ? 0.0 : kMiddle; };
  ThreePhase parts = by_phase(part, terminal_v);
  const int terminals = terminal_count(connection);
  double sum = 0.0;
  int held = 0;
  for (int k = 0; k < terminals; ++k) {
    if ((floating & terminal_bit(k)) != 0) continue;
    sum += phase(parts, k);
    ++held;
  }
  const double mean = connection == Connection::kStar && held > 0 ? sum / held : kMiddle;
  for (int k = 0; k < terminals; ++k) {
    if ((floating & terminal_bit(k)) != 0) phase(parts, k) = mean;
  }
  return parts;
}

PhaseValues with_floating(Connection connection, TerminalSet floating, const PhaseValues& conducting_v,
                          const WindingValues& winding_v) noexcept {
  const Phases winding = winding_phases(connection, winding_v);
  Phases v{conducting_v.a, conducting_v.b, conducting_v.c};
  double neutral_v = 0.0;
  int conducting = 0;
  for (int k = 0; k < 3 && connection == Connection::kStar; ++k) {
    if ((floating & terminal_bit(k)) != 0) continue;
    neutral_v += v[at(k)] - winding[at(k)];
    ++conducting;
  }
  if (conducting > 1) neutral_v /= conducting;
  for (int k = 0; k < terminal_count(connection); ++k) {
    if ((floating & terminal_bit(k)) != 0) v[at(k)] = neutral_v + winding[at(k)];
  }
  return {.a = v[0], .b = v[1], .c = v[2], .field = conducting_v.field};
}

PhaseValues behind_switches(Connection connection, const TerminalDrive& drive, const PhaseValues& ideal_v,
                            const PhaseValues& current_a) noexcept {
  PhaseValues v = ideal_v;
  const TerminalSet driven = driven_terminals(connection, drive);
  if ((driven & 1u) != 0) v.a -= drive.switch_ohm * current_a.a;
  if ((driven & 2u) != 0) v.b -= drive.switch_ohm * current_a.b;
  if ((driven & 4u) != 0) v.c -= drive.switch_ohm * current_a.c;
  return v;
}

bool diodes_block(Connection connection, const TerminalDrive& drive,
                  const WindingValues& open_circuit_v) noexcept {
  const Phases emf_v = winding_phases(connection, open_circuit_v);
  const double most_v = drive.conducts_above_v(all_terminals(connection));
  double highest_v = -most_v;
  double lowest_v = most_v;
  for (int k = 0; k < terminal_count(connection); ++k) {
    if (drive.mode[at(k)] != TerminalMode::kDiodes) continue;
    highest_v = std::max(highest_v, emf_v[at(k)]);
    lowest_v = std::min(lowest_v, emf_v[at(k)]);
  }
  if (connection == Connection::kStar) return highest_v - lowest_v <= 2.0 * most_v;
  return highest_v <= most_v && lowest_v >= -most_v;
}

TerminalCircuit connect(Connection connection, const TerminalDrive& drive, const InjectedFaults& faults,
                        const PhaseValues& current_a, WindingVoltagesOf winding_v,
                        TerminalSet& open) noexcept {
  Work w = work_of(connection, drive, current_a, winding_v, open);
  const Shorts shorts = shorts_of(faults, w.count);
  decide(w, shorts);

  TerminalCircuit circuit{.constant = drive.constant, .dying = w.dying};
  const auto input = [&](const ThreePhase& driven_v, PhaseValues& terminal_v) noexcept {
    const Phases v = terminals_at(w, shorts, driven_v, circuit.short_circuit);
    terminal_v = {.a = v[0], .b = v[1], .c = v[2], .field = drive.field_v};
    return circuit_input(w, v);
  };
  circuit.start = input(drive.start_v, circuit.start_v);
  if (drive.switch_ohm != 0.0)
    circuit.start_v = behind_switches(connection, drive, circuit.start_v, current_a);
  if (drive.constant) {
    circuit.mean_v = circuit.end_v = circuit.start_v;
  } else {
    PhaseValues middle_v;
    circuit.middle = input(drive.middle_v, middle_v);
    circuit.end = input(drive.end_v, circuit.end_v);
    circuit.mean_v = simpson_mean(circuit.start_v, middle_v, circuit.end_v);
  }
  open = w.open;
  return circuit;
}

PhaseValues connected_voltages(Connection connection, const TerminalDrive& drive,
                               const InjectedFaults& faults, const PhaseValues& current_a,
                               WindingVoltagesOf winding_v, TerminalSet open) noexcept {
  Work w = work_of(connection, drive, current_a, winding_v, open);
  const Shorts shorts = shorts_of(faults, w.count);
  decide(w, shorts);
  bool short_circuit = false;
  const Phases v = terminals_at(w, shorts, drive.start_v, short_circuit);
  const PhaseValues terminal_v{.a = v[0], .b = v[1], .c = v[2], .field = drive.field_v};
  return drive.switch_ohm == 0.0 ? terminal_v : behind_switches(connection, drive, terminal_v, current_a);
}

}  // namespace drivebench
