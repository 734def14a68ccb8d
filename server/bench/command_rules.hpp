#pragma once

#include <cstdint>

#include "plant/drive/drive.hpp"
#include "server/bench/input.hpp"

namespace drivebench {

/// What becomes of a command that asks for more than the drive can give, or for it too fast.
enum class OnExcess : std::uint32_t {
  kSaturate,  ///< it is limited, and a bit of the fault word says so
  kRefuse,    ///< it is refused as a whole and counts as missing
};

/// What a command of an axis must keep to.
struct CommandRules {
  OnExcess on_excess = OnExcess::kSaturate;
  double slew_per_s = 0.0;  ///< largest slope of a set-point [V/s], or [A/s] of a current; 0: none
};

/// Largest magnitude of a set-point, [V] or [A]; beyond it a number is an accident and refused by every axis.
inline constexpr double kMaxSetpoint = 1e6;

/// What decides whether an axis takes a command.
struct CommandView {
  Owner owner = 0;   ///< of the lease of the axis
  Tick tick = 0;     ///< of the newest sample
  Command newest{};  ///< the last command that the axis took under this lease; it answers -1 if there is none
  bool is_latched = false;
  double step = 0.0;  ///< largest change of a set-point in a tick [V or A]; 0: any
  const CommandRules& rules;
  const DriveParameters& drive;
};

/// The change of a set-point in a tick that the rules allow [V or A]; 0: any.
constexpr double largest_step(const CommandRules& rules, std::int64_t period_ns) noexcept {
  return rules.slew_per_s * (static_cast<double>(period_ns) * 1e-9);
}

/// Why an axis refuses a command of `sender`. In this order: the sender must hold the lease; the values must
/// be finite, no accident, of a kind that the drive knows and, with OnExcess::kRefuse, within its limits; the
/// command must answer a sample that has been taken and not been answered; with OnExcess::kRefuse its
/// set-points must be near enough to those of the command before; under a latched fault the gates must be
/// off.
Refused judge(const Command& command, Owner sender, const CommandView& axis) noexcept;

/// Whether `command` is further away from `before` than this step; a command with other gates starts at 0.
bool is_steeper(const PhaseCommand& before, const PhaseCommand& command, double step) noexcept;

/// The command, each set-point no further away than this step from that of the one before.
PhaseCommand slewed(const PhaseCommand& before, const PhaseCommand& command, double step) noexcept;

}  // namespace drivebench
