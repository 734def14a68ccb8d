#pragma once

#include <array>
#include <cstdint>

#include "plant/windings.hpp"

namespace drivebench {

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
  bool constant = true;   ///< the voltages stay as they are at the start
  ThreePhase start_v{};   ///< of driven terminals, at the start of the interval,
  ThreePhase middle_v{};  ///< in its middle
  ThreePhase end_v{};     ///< and at its end; the last two only if not constant
  double rail_v = 0.0;    ///< diodes clamp to plus and minus this
  double field_v = 0.0;
};

}  // namespace drivebench
