#pragma once

#include <cstdint>

#include "plant/math/frames.hpp"
#include "protocols/signals/command.hpp"

/// The windings of a machine for the drive and the shaft, whatever its kind.
namespace drivebench {

struct MachineKind;  // plant/parameters/machine_kind.hpp

/// The connection of the windings of a stator to the terminals.
enum class Connection : std::int64_t {
  kTwoPhase,     ///< windings a and b, each between the legs of a bridge of its own
  kStar,         ///< windings a, b, c of an isolated star: the neutral floats
  kIndependent,  ///< windings a, b, c, each between the legs of a bridge of its own
  kArmature,     ///< winding a alone
};

constexpr int terminal_count(Connection connection) noexcept {
  if (connection == Connection::kArmature) return 1;
  return connection == Connection::kTwoPhase ? 2 : 3;
}

/// The supply of the field winding of a machine.
enum class FieldSupply : std::int64_t {
  kNone,          ///< there is none: magnets or a cage
  kOnArmature,    ///< fed from the terminals of the armature; its current can be measured
  kOwnTerminals,  ///< the same with terminals of its own, which a command drives
};

/// One value for each winding. The stator is in two-phase, power-invariant coordinates; `zero` is the third
/// row of that transform, (x_a + x_b + x_c)/sqrt(3), which only independent phases have. An armature is
/// stator.a.
struct WindingValues {
  TwoPhase stator{};
  double zero = 0.0;
  double field = 0.0;
};

/// The stator currents that the circuit outside of the machine lets change.
enum class Conduction : std::int64_t {
  kFull,  ///< all of them
  kLine,  ///< only along one direction of the plane (one open phase)
  kNone,  ///< none: the stator is open
};

/// The circuit that is connected to the windings.
struct TerminalInput {
  TwoPhase voltage_v{};  ///< of the stator
  double zero_v = 0.0;   ///< of the zero sequence; independent phases only
  double field_v = 0.0;
  Conduction conduction = Conduction::kFull;
  TwoPhase line{};                     ///< kLine: unit vector along which current may flow
  ThreePhase conducts{1.0, 1.0, 1.0};  ///< independent phases: 0 where the phase is open
};

namespace windings_detail {

/// Out of line, so that the common cases stay small, and cold, so that they keep their values in registers: a
/// call leaves none of the vector registers as it was.
[[gnu::noinline, gnu::cold]] inline TwoPhase along_line(TwoPhase x, const TerminalInput& u) noexcept {
  const double along = u.line.a * x.a + u.line.b * x.b;
  return {.a = along * u.line.a, .b = along * u.line.b};
}

}  // namespace windings_detail

/// The part of a stator current, or of its slope in a machine with the same inductance in every direction,
/// that the circuit lets through.
inline TwoPhase conducted(TwoPhase x, const TerminalInput& u) noexcept {
  if (u.conduction == Conduction::kFull) [[likely]]
    return x;
  if (u.conduction == Conduction::kNone) return {.a = 0.0, .b = 0.0};
  return windings_detail::along_line(x, u);
}

/// The motion of the rotor at one instant.
struct RotorMotion {
  double angle_rad;  ///< of the shaft, within its turn or a little beyond
  double speed_rad_s;
  CosSin electrical;  ///< of n_p times the angle
};

/// The differences from the nameplate: heat, faults, and an impedance in series with the stator.
struct Adjustment {
  double stator_resistance_factor = 1.0;
  double rotor_resistance_factor = 1.0;  ///< rotor cage, or field winding
  double magnet_factor = 1.0;            ///< of what the permanent magnet gives
  double series_resistance_ohm = 0.0;    ///< per stator winding
  double series_inductance_h = 0.0;
};

}  // namespace drivebench
