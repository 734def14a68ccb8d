#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "plant/drive/terminal_drive.hpp"
#include "plant/injected_faults.hpp"
#include "plant/windings.hpp"

namespace drivebench {

/// The set of terminal k alone.
constexpr TerminalSet terminal_bit(int k) noexcept {
  return TerminalSet{1} << k;
}

constexpr TerminalSet all_terminals(Connection connection) noexcept {
  return (TerminalSet{1} << terminal_count(connection)) - 1;
}

/// The circuit of the windings during an interval, derived from the connection of the terminals to the drive.
struct TerminalCircuit {
  TerminalInput start{};
  TerminalInput middle{};  ///< the voltages of start if `constant`
  TerminalInput end{};
  bool constant = true;
  TerminalSet dying = 0;  ///< off the drive, with a current that flows on: its zero is an event
  PhaseValues start_v{};  ///< of the terminals: across the winding, in a star against the link's middle
  PhaseValues mean_v{};
  PhaseValues end_v{};
  bool short_circuit = false;  ///< a short lies between two driven terminals of different voltage
};

/// Asks a machine for the voltages of its windings, R i + d(flux)/dt, where the circuit lets the currents of
/// this TerminalInput flow. Keeps a reference to the callable.
class WindingVoltagesOf {
 public:
  template <class Ask>
  explicit WindingVoltagesOf(const Ask& ask) noexcept
      : asked_(&ask), call_([](const void* asked, const TerminalInput& u) noexcept {
          return (*static_cast<const Ask*>(asked))(u);
        }) {}

  WindingValues operator()(const TerminalInput& u) const noexcept { return call_(asked_, u); }

 private:
  const void* asked_;
  WindingValues (*call_)(const void*, const TerminalInput&) noexcept;
};

/// The currents of the terminals, exactly zero where one is open.
inline PhaseValues terminal_currents(Connection connection, const WindingValues& x,
                                     TerminalSet open) noexcept {
  ThreePhase i{x.stator.a, x.stator.b, 0.0};
  if (connection == Connection::kStar || connection == Connection::kIndependent) {
    i = two_to_three(x.stator);
    const double zero = connection == Connection::kIndependent ? frames_detail::kRootThird * x.zero : 0.0;
    i = {.a = i.a + zero, .b = i.b + zero, .c = i.c + zero};
  }
  return {.a = (open & 1u) != 0 ? 0.0 : i.a,
          .b = (open & 2u) != 0 ? 0.0 : i.b,
          .c = (open & 4u) != 0 ? 0.0 : i.c,
          .field = x.field};
}

/// The conduction that open terminals leave; voltages zero.
TerminalInput open_input(Connection connection, TerminalSet open) noexcept;

/// Connects drive and windings. `open` are the terminals that carry no current because a diode blocks or a
/// wire is broken; the function takes out those that are driven again or whose diodes begin to conduct (what
/// the machine induces there is beyond a rail), and puts in those without current.
TerminalCircuit connect(Connection connection, const TerminalDrive& drive, const InjectedFaults& faults,
                        const PhaseValues& current_a, WindingVoltagesOf winding_v,
                        TerminalSet& open) noexcept;

/// TerminalCircuit::start_v of connect() alone, for terminals of constant voltage: where an interval has
/// ended its circuit is not asked for.
PhaseValues connected_voltages(Connection connection, const TerminalDrive& drive,
                               const InjectedFaults& faults, const PhaseValues& current_a,
                               WindingVoltagesOf winding_v, TerminalSet open) noexcept;

/// The voltages of terminals without current.
PhaseValues open_terminal_voltages(Connection connection, const WindingValues& open_circuit_v,
                                   double field_v) noexcept;

/// The voltages of all terminals where those of `floating` carry no current: they are where the winding
/// voltages put them, in a star above the neutral that the others give.
PhaseValues with_floating(Connection connection, TerminalSet floating, const PhaseValues& conducting_v,
                          const WindingValues& winding_v) noexcept;

/// The voltage of a terminal against the negative rail. A winding between two legs hangs in the middle
/// between the rails, because its legs switch together: this is the terminal of its first leg.
constexpr double above_negative_rail(Connection connection, double terminal_v, double rail_v) noexcept {
  return connection == Connection::kStar ? terminal_v + rail_v : 0.5 * (terminal_v + rail_v);
}

/// How far each terminal, at these voltages, goes with a link that moves, against the negative rail: one at
/// the upper rail wholly, one at the lower rail not at all, a floating one of a star as the mean of the
/// others.
ThreePhase parts_of_link(Connection connection, const ThreePhase& terminal_v, TerminalSet floating) noexcept;

/// The terminals of an open star against the negative rail of a link: no switch holds its neutral, and the
/// diodes hold no terminal beyond a rail and their forward voltage.
constexpr ThreePhase within_rails(const ThreePhase& v, double link_v, double diode_v) noexcept {
  const double high_v = std::max({v.a, v.b, v.c});
  const double low_v = std::min({v.a, v.b, v.c});
  const double most_v = link_v + diode_v;
  const double shift_v = high_v > most_v ? most_v - high_v : low_v < -diode_v ? -diode_v - low_v : 0.0;
  return {.a = v.a + shift_v, .b = v.b + shift_v, .c = v.c + shift_v};
}

constexpr TerminalSet driven_terminals(Connection connection, const TerminalDrive& drive) noexcept {
  TerminalSet driven = 0;
  for (int k = 0; k < terminal_count(connection); ++k) {
    if (drive.mode[static_cast<std::size_t>(k)] == TerminalMode::kDriven) driven |= TerminalSet{1} << k;
  }
  return driven;
}

constexpr int driven_count(Connection connection, const TerminalDrive& drive) noexcept {
  int driven = 0;
  for (int k = 0; k < terminal_count(connection); ++k)
    driven += drive.mode[static_cast<std::size_t>(k)] == TerminalMode::kDriven ? 1 : 0;
  return driven;
}

/// The voltages of terminals of which the driven ones were those before their switches, at these currents.
PhaseValues behind_switches(Connection connection, const TerminalDrive& drive, const PhaseValues& ideal_v,
                            const PhaseValues& current_a) noexcept;

/// Whether the diodes of terminals of which none is driven block: no emf is beyond them.
bool diodes_block(Connection connection, const TerminalDrive& drive,
                  const WindingValues& open_circuit_v) noexcept;

namespace terminals_detail {

/// The voltage that drives a current to zero: that of a terminal on its diode, or the arc of a broken wire.
constexpr double against(double current_a, double clamp_v) noexcept {
  return current_a > 0.0 ? -clamp_v : clamp_v;
}

}  // namespace terminals_detail

/// The common case of connect(), without a short: every terminal carries a current, because it is driven or
/// because its current goes on through a diode. `terminal_v` are then the voltages, and `dying`
/// those on a diode.
constexpr bool all_conduct(Connection connection, const TerminalDrive& drive, TerminalSet open,
                           const PhaseValues& current_a, ThreePhase& terminal_v,
                           TerminalSet& dying) noexcept {
  terminal_v = drive.start_v;
  dying = 0;
  const auto conducts = [&](int k, double i, double& v) noexcept {
    if (drive.mode[static_cast<std::size_t>(k)] == TerminalMode::kDriven) return true;
    if ((open >> k & 1u) != 0 || i == 0.0) return false;
    dying |= TerminalSet{1} << k;
    v = terminals_detail::against(i, drive.clamp_v());
    return true;
  };
  const int count = terminal_count(connection);
  return conducts(0, current_a.a, terminal_v.a) && (count < 2 || conducts(1, current_a.b, terminal_v.b)) &&
         (count < 3 || conducts(2, current_a.c, terminal_v.c));
}

struct WindingVoltages {
  TwoPhase stator_v;
  double zero_v;
};

/// Voltages of the windings from those of the terminals.
constexpr WindingVoltages winding_voltages(Connection connection, const ThreePhase& v) noexcept {
  if (connection == Connection::kTwoPhase || connection == Connection::kArmature) {
    return {.stator_v = {.a = v.a, .b = v.b}, .zero_v = 0.0};
  }
  return {
      .stator_v = three_to_two(v),
      .zero_v = connection == Connection::kIndependent ? frames_detail::kRootThird * (v.a + v.b + v.c) : 0.0};
}

}  // namespace drivebench
