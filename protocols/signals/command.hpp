#pragma once

#include <cstdint>

namespace drivebench {

/// The state of the gates during a tick; the numbers are those of Gates in bench.proto.
enum class Gates : std::int32_t {
  kOff = 0,          ///< freewheel: currents flow through the diodes into the DC link until they are zero
  kVoltage = 1,      ///< the commanded voltages
  kZeroVoltage = 2,  ///< active short circuit
  kCurrent = 3,      ///< the commanded currents, by the current loop of the drive
  kDuty = 4,         ///< the commanded duties of the legs, with their common part
};

/// One value for each terminal: phases a, b, c and the field. A machine with fewer terminals leaves the
/// others at zero; an armature is phase a.
struct PhaseValues {
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;
  double field = 0.0;
};

/// The bits of PhaseCommand::legs_off.
inline constexpr std::uint32_t kAllLegs = 7;

/// The command that the drive carries out for one whole tick. In a star the voltages are those of the
/// terminals against the middle of the DC link, and an inverter chooses their common part. A duty of a star's
/// leg is its mean voltage against the negative rail over the link's, 0 to 1; that of a winding between two
/// legs, and of the field, its voltage over the link's, -1 to 1.
///
/// Gates and legs_off make one 8-byte word of saved states.
struct PhaseCommand {
  Gates gates = Gates::kOff;
  std::uint32_t legs_off = 0;  ///< legs (of a winding between two: both) that are off: 1 a, 2 b, 4 c
  PhaseValues setpoint{};      ///< [V], with Gates::kCurrent [A], with Gates::kDuty a part of the link
};

/// The command of a controller for an axis, in answer to the sample of one tick.
struct Command {
  std::int64_t answers = -1;  ///< the tick; -1: none
  PhaseCommand phases{};
};

}  // namespace drivebench
