#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace drivebench {

/// The state of the gates during a tick; the numbers are those of Gates in bench.proto.
enum class Gates : std::int32_t {
  kOff = 0,          ///< freewheel: currents flow through the diodes into the DC link until they are zero
  kVoltage = 1,      ///< the commanded voltages
  kZeroVoltage = 2,  ///< active short circuit
  kCurrent = 3,      ///< the commanded currents, by the current loop of the drive
  kDuty = 4,         ///< the commanded duties of the legs, with their common part
  kEdges = 5,        ///< the commanded edges of the legs, within the tick
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

/// The position of a leg; the numbers are those of LegLevel in bench.proto. Of a winding between two legs: of
/// the first, and the second has the other one.
enum class LegLevel : std::uint32_t {
  kNone = 0,  ///< no edge
  kOff = 1,   ///< both switches open: the current flows on through a diode
  kLow = 2,   ///< at the negative rail
  kHigh = 3,  ///< at the positive rail
};

/// The positions of legs a, b, c.
using LegLevels = std::array<LegLevel, 3>;

/// From this instant of the tick on a leg has this position.
class LegEdge {
 public:
  constexpr LegEdge() noexcept = default;
  /// The offset is below 2^30 ns.
  constexpr LegEdge(std::uint32_t offset_ns, LegLevel level) noexcept
      : word_(offset_ns << 2 | static_cast<std::uint32_t>(level)) {}
  constexpr std::uint32_t offset_ns() const noexcept { return word_ >> 2; }
  constexpr LegLevel level() const noexcept { return static_cast<LegLevel>(word_ & 3U); }

 private:
  std::uint32_t word_ = 0;
};

inline constexpr std::size_t kMaxLegEdges = 8;
inline constexpr std::uint32_t kMaxOffsetNs = (1U << 30) - 1;

/// The edges of a leg in a tick in the order of their offsets; LegLevel::kNone ends a list that is not full.
using LegEdgeList = std::array<LegEdge, kMaxLegEdges>;

/// The edges of legs a, b, c.
using LegEdges = std::array<LegEdgeList, 3>;

/// The command that the drive carries out for one whole tick. In a star the voltages are those of the
/// terminals against the middle of the DC link, and an inverter chooses their common part. A duty of a star's
/// leg is its mean voltage against the negative rail over the link's, 0 to 1; that of a winding between two
/// legs, and of the field, its voltage over the link's, -1 to 1.
///
/// A leg keeps the position that its list of edges of the tick before has ended with until the first edge of
/// the new list; after other gates it is off, and so is a leg without a list.
///
/// Gates and legs_off make one 8-byte word of saved states, and so do two edges.
struct PhaseCommand {
  Gates gates = Gates::kOff;
  std::uint32_t legs_off = 0;  ///< legs (of a winding between two: both) that are off: 1 a, 2 b, 4 c
  PhaseValues setpoint{};      ///< [V], with Gates::kCurrent [A], with Gates::kDuty a part of the link
  LegEdges edges{};            ///< Gates::kEdges; the field has its set-point as with Gates::kDuty
};

/// The command of a controller for an axis, in answer to the sample of one tick.
struct Command {
  std::int64_t answers = -1;  ///< the tick; -1: none
  PhaseCommand phases{};
};

}  // namespace drivebench
