#include "server/bench/command_rules.hpp"

#include <algorithm>
#include <cmath>

#include "plant/drive/phases.hpp"

namespace drivebench {
namespace {

double largest(const PhaseValues& x) noexcept {
  return std::max({std::abs(x.a), std::abs(x.b), std::abs(x.c), std::abs(x.field)});
}

/// What is in force before a command with these gates.
PhaseValues start_of(const PhaseCommand& before, Gates gates) noexcept {
  return before.gates == gates ? before.setpoint : PhaseValues{};
}

}  // namespace

Refused check_values(const PhaseCommand& command, const CommandRules& rules,
                     const DriveParameters& drive) noexcept {
  if (!is_finite(command)) return Refused::kNotFinite;
  if (!suits(drive.kind, command.gates)) return Refused::kWrongDrive;
  const double magnitude = largest(command.setpoint);
  if (magnitude > kMaxSetpoint) return Refused::kBeyondDrive;
  if (rules.on_excess == OnExcess::kSaturate) return Refused::kNot;
  const double limit =
      command.gates == Gates::kCurrent ? drive.current_loop.limit_a : drive.amplifier.voltage_limit_v;
  return magnitude > limit ? Refused::kBeyondDrive : Refused::kNot;
}

bool is_steeper(const PhaseCommand& before, const PhaseCommand& command, double step) noexcept {
  const PhaseValues from = start_of(before, command.gates);
  const auto difference = [](double a, double b) { return b - a; };
  return largest(by_terminal(difference, from, command.setpoint)) > step;
}

PhaseCommand slewed(const PhaseCommand& before, const PhaseCommand& command, double step) noexcept {
  const PhaseValues from = start_of(before, command.gates);
  const auto towards = [step](double a, double b) { return std::clamp(b, a - step, a + step); };
  return {.gates = command.gates, .setpoint = by_terminal(towards, from, command.setpoint)};
}

}  // namespace drivebench
