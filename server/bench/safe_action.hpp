#pragma once

#include <cstdint>

#include "plant/tick.hpp"
#include "plant/windings.hpp"
#include "protocols/signals/command.hpp"

namespace drivebench {

/// The action of the bench on an axis whose commands have ended.
enum class SafeAction : std::uint32_t {
  kFreewheel,    ///< gates off: currents flow through the diodes into the DC link until they are zero
  kZeroVoltage,  ///< active short circuit: the machine brakes against its own resistance
  kHold,         ///< the last set-points stay, fixed in the stator frame, as PWM registers keep them
  kQuickStop,    ///< magnitude and frequency of the last set-points go to zero in a ramp, then freewheel
};

/// The last commands that an axis was driven with, as far as its safe action needs them. 8-byte members only.
struct LastCommands {
  PhaseCommand command{};
  double angle_rad = 0.0;          ///< electrical, of the set-point
  double turn_rad_per_tick = 0.0;  ///< mean of the last ones
  std::int64_t followed = 0;       ///< number of commands in the mean
  Tick gone = 0;                   ///< ticks of safe action since
};

/// The axis is driven with `command` in this tick.
void follow(LastCommands& last, const PhaseCommand& command, Connection connection, bool turns) noexcept;

/// The set-points of the last tick: those of the last command, or of the safe action that has followed it
/// since.
PhaseCommand in_force(const LastCommands& last, SafeAction action, Connection connection,
                      Tick quick_stop_ticks) noexcept;

/// The set-points of the next tick of the safe action. A fault of the machine or the bench (`faulty`) leaves
/// only freewheel and zero voltage: hold and quick stop then are freewheel.
PhaseCommand act_safely(LastCommands& last, SafeAction action, bool faulty, Connection connection,
                        Tick quick_stop_ticks) noexcept;

}  // namespace drivebench
