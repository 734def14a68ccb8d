#pragma once

#include <cstdint>

namespace drivebench {

/// The state of the gates during a tick; the numbers are those of Gates in bench.proto.
enum class Gates : std::int64_t {
  kOff = 0,          ///< freewheel: currents flow through the diodes into the DC link until they are zero
  kVoltage = 1,      ///< the commanded voltages
  kZeroVoltage = 2,  ///< active short circuit
  kCurrent = 3,      ///< the commanded currents, by the current loop of the drive
};

/// One value for each terminal: phases a, b, c and the field. A machine with fewer terminals leaves the
/// others at zero; an armature is phase a.
struct PhaseValues {
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;
  double field = 0.0;
};

/// The command that the drive carries out for one whole tick. In a star the voltages are those of the
/// terminals against the middle of the DC link: a common part does nothing.
struct PhaseCommand {
  Gates gates = Gates::kOff;
  PhaseValues setpoint{};  ///< [V], or [A] with Gates::kCurrent
};

/// The command of a controller for an axis, in answer to the sample of one tick.
struct Command {
  std::int64_t answers = -1;  ///< the tick; -1: none
  PhaseCommand phases{};
};

}  // namespace drivebench
