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

/// Whether the values of a command are such that the axis takes it: finite, no accident, of a kind that the
/// drive knows, and with OnExcess::kRefuse within the limits of the drive.
Refused check_values(const PhaseCommand& command, const CommandRules& rules,
                     const DriveParameters& drive) noexcept;

/// Whether `command` is further away from `before` than this step; a command with other gates starts at 0.
bool is_steeper(const PhaseCommand& before, const PhaseCommand& command, double step) noexcept;

/// The command, each set-point no further away than this step from that of the one before.
PhaseCommand slewed(const PhaseCommand& before, const PhaseCommand& command, double step) noexcept;

}  // namespace drivebench
