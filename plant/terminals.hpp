#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "plant/drive/terminal_drive.hpp"
#include "plant/injected_faults.hpp"
#include "plant/windings.hpp"

namespace drivebench {

/// A set of terminals: bit 0 is a, bit 1 b, bit 2 c.
using TerminalSet = std::uint64_t;

constexpr TerminalSet all_terminals(Connection connection) noexcept {
  return (TerminalSet{1} << terminal_count(connection)) - 1;
}

/// What the windings see during an interval, from what the drive does to the terminals.
struct TerminalCircuit {
  TerminalInput start{};
  TerminalInput middle{};  ///< the voltages of start if `constant`
  TerminalInput end{};
  bool constant = true;
  TerminalSet dying = 0;  ///< terminals off the drive whose current flows on: its zero is an event
  PhaseValues start_v{};  ///< of the terminals: across the winding, in a star against the link's middle
  PhaseValues mean_v{};
  PhaseValues end_v{};
  bool short_circuit = false;  ///< a short lies between two driven terminals of different voltage
};

/// The currents of the terminals, exactly zero where one is open.
PhaseValues terminal_currents(Connection connection, const WindingValues& currents,
                              TerminalSet open) noexcept;

/// The conduction that open terminals leave; voltages zero.
TerminalInput open_input(Connection connection, TerminalSet open) noexcept;

/// Connects drive and windings. `open` are the terminals that carry no current because a diode blocks or a
/// wire is broken; the function takes out those that are driven again or whose diodes begin to conduct (the
/// emf `open_circuit_v` is beyond a rail), and puts in those without current.
TerminalCircuit connect(Connection connection, const TerminalDrive& drive, const InjectedFaults& faults,
                        const PhaseValues& current_a, const WindingValues& open_circuit_v,
                        TerminalSet& open) noexcept;

/// The voltages of terminals without current.
PhaseValues open_terminal_voltages(Connection connection, const WindingValues& open_circuit_v,
                                   double field_v) noexcept;

/// No terminal is driven, and no emf opens a diode.
bool diodes_block(Connection connection, const TerminalDrive& drive,
                  const WindingValues& open_circuit_v) noexcept;

/// Another common case: whether terminals without current stay without.
inline bool stays_open(Connection connection, const TerminalDrive& drive,
                       const WindingValues& open_circuit_v) noexcept {
  bool driven = false;
  for (int k = 0; k < terminal_count(connection); ++k)
    driven = driven || drive.mode[static_cast<std::size_t>(k)] == TerminalMode::kDriven;
  // No phase has more than the sum of the components.
  const double most_v = std::abs(open_circuit_v.stator.a) + std::abs(open_circuit_v.stator.b) +
                        std::abs(open_circuit_v.zero);
  return (!driven && most_v <= drive.rail_v) || diodes_block(connection, drive, open_circuit_v);
}

/// The common case of connect(): every terminal is driven and nothing is shorted.
constexpr bool all_driven(Connection connection, const TerminalDrive& drive) noexcept {
  for (int k = 0; k < terminal_count(connection); ++k) {
    if (drive.mode[static_cast<std::size_t>(k)] != TerminalMode::kDriven) return false;
  }
  return true;
}

/// Voltages of the windings from those of the terminals.
constexpr TerminalInput winding_input(Connection connection, const ThreePhase& v, double field_v) noexcept {
  TerminalInput u;
  u.field_v = field_v;
  if (connection == Connection::kTwoPhase || connection == Connection::kArmature) {
    u.voltage_v = {.a = v.a, .b = v.b};
  } else {
    u.voltage_v = three_to_two(v);
    u.zero_v = connection == Connection::kIndependent ? frames_detail::kRootThird * (v.a + v.b + v.c) : 0.0;
  }
  return u;
}

}  // namespace drivebench
