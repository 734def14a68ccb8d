#pragma once

#include <array>
#include <cstdint>

#include "plant/windings.hpp"

namespace drivebench {

/// A set of terminals: bit 0 is a, bit 1 b, bit 2 c.
using TerminalSet = std::uint64_t;

/// The connection of a terminal during an interval.
enum class TerminalMode : std::int64_t {
  kDriven,  ///< a voltage
  kDiodes,  ///< the diodes of a leg with both switches off: the current flows into a rail until it is zero
  kOpen,    ///< a broken wire: the current dies in an arc at the rail voltage and does not come back
};

/// The connection of all terminals to the drive during an interval within a tick. Voltages of a star are
/// against the middle of the DC link, those of the other connections across the winding.
struct TerminalDrive {
  std::array<TerminalMode, 3> mode{};
  bool constant = true;      ///< the voltages stay as they are at the start
  ThreePhase start_v{};      ///< of driven terminals, at the start of the interval,
  ThreePhase middle_v{};     ///< in its middle
  ThreePhase end_v{};        ///< and at its end; the last two only if not constant
  double rail_v = 0.0;       ///< plus and minus this are the rails; their mean, if the link moves
  double link_rise_v = 0.0;  ///< by which the link is above that at the end of the interval
  bool link_moves = false;   ///< the rails are those of this interval alone
  double field_v = 0.0;
  double diode_v = 0.0;      ///< forward voltage of the diodes between a terminal and a rail
  double switch_ohm = 0.0;   ///< of the closed switches between a driven terminal and its voltage
  TerminalSet turns_on = 0;  ///< floating terminals that began to conduct where the interval before ended

  /// Diodes clamp to plus and minus this.
  constexpr double clamp_v() const noexcept { return rail_v + diode_v; }
  /// Where a floating terminal passes this, the interval ends.
  constexpr double turns_on_at_v() const noexcept { return clamp_v() * (1.0 + 1e-12); }
  /// Beyond this it conducts from the start of an interval on. A terminal that rounding puts on its rail does
  /// not; one that has passed turns_on_at_v() does although its rail may have moved on a little.
  constexpr double conducts_above_v(TerminalSet terminals) const noexcept {
    constexpr double kMovedOn = 1e-2;
    return clamp_v() * ((turns_on & terminals) != 0 ? 1.0 - kMovedOn : 1.0 + 5e-13);
  }
};

}  // namespace drivebench
