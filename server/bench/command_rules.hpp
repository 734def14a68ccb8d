#pragma once

#include <cstdint>

#include "plant/drive/drive.hpp"
#include "protocols/leg_edges.hpp"
#include "server/bench/input.hpp"

namespace drivebench {

/// The reaction to a command beyond the limits of the drive or `slew_per_s`.
enum class OnExcess : std::uint32_t {
  kSaturate,  ///< limited, with a bit in the fault word
  kRefuse,    ///< refused as a whole; counts as missing
};

/// The rules for commands of an axis.
struct CommandRules {
  OnExcess on_excess = OnExcess::kSaturate;
  double slew_per_s = 0.0;  ///< largest slope of a set-point [V/s], or [A/s] of a current; 0: no limit
};

/// The largest magnitude of a set-point [V] or [A]; every axis refuses larger numbers as accidents.
inline constexpr double kMaxSetpoint = 1e6;

/// The state of an axis that decides whether it takes a command.
struct CommandView {
  Owner owner = 0;   ///< of the lease of the axis
  Tick tick = 0;     ///< of the newest sample
  Command newest{};  ///< the last command that the axis took under this lease; it answers -1 if there is none
  bool is_latched = false;
  std::int64_t period_ns = 0;  ///< of the bench
  double step = 0.0;           ///< largest change of a set-point in a tick [V or A]; 0: any
  Connection connection = Connection::kTwoPhase;
  const CommandRules& rules;
  const DriveParameters& drive;
  bool takes_voltages = false;  ///< those of another axis, whose amplifier it shares
};

/// The change of a set-point in a tick that the rules allow [V or A]; 0: any.
constexpr double largest_step(const CommandRules& rules, std::int64_t period_ns) noexcept {
  return rules.slew_per_s * (static_cast<double>(period_ns) * 1e-9);
}

/// The reason why an axis refuses a command of `sender`. In this order: the axis must have an amplifier of
/// its own; the sender must hold the lease; the values must be finite, no accident, of a kind that the drive
/// takes and, with OnExcess::kRefuse, within its limits; the command must answer a sample that has been taken
/// and not been answered; with OnExcess::kRefuse its set-points must be near enough to those of the command
/// before; under a latched fault the gates must be off.
Refused judge(const Command& command, Owner sender, const CommandView& axis) noexcept;

/// A change of set-points that the rules allow.
struct LargestChange {
  double step;  ///< [V or A]; of duties the part of the supply's voltage
  Connection connection;
};

/// `step` for set-points of this kind.
LargestChange largest_change(double step, Gates gates, Connection connection,
                             const DriveParameters& drive) noexcept;

/// Whether a set-point of `command` differs from `before` by more than the change; a command with other gates
/// starts from 0, the duties of a star from half.
bool is_steeper(const PhaseCommand& before, const PhaseCommand& command,
                const LargestChange& largest) noexcept;

/// The command with each set-point limited to this change from `before`.
PhaseCommand slewed(const PhaseCommand& before, const PhaseCommand& command,
                    const LargestChange& largest) noexcept;

}  // namespace drivebench
