#pragma once

#include <cstdint>

#include "plant/windings.hpp"

namespace drivebench {

/// What the gates do during a tick.
enum class Gates : std::int64_t {
  kOff = 0,          ///< freewheel: currents flow through the diodes into the DC link until they are zero
  kVoltage = 1,      ///< the commanded voltages
  kZeroVoltage = 2,  ///< active short circuit
  kCurrent = 3,      ///< the commanded currents, by the current loop of the drive
};

/// What a controller (or the safe action) asks of the drive for one tick; zero-order hold. In a star the
/// voltages are those of the terminals against the middle of the DC link: a common part does nothing.
struct PhaseCommand {
  Gates gates = Gates::kOff;
  PhaseValues setpoint{};  ///< [V], or [A] with Gates::kCurrent
};

}  // namespace drivebench
