#include "server/bench/command_rules.hpp"

#include <algorithm>
#include <cmath>

#include "plant/drive/phases.hpp"

namespace drivebench {
namespace {

double largest(const PhaseValues& x) noexcept {
  return std::max({std::abs(x.a), std::abs(x.b), std::abs(x.c), std::abs(x.field)});
}

/// The set-points in force before a command with these gates.
PhaseValues start_of(const PhaseCommand& before, Gates gates) noexcept {
  return before.gates == gates ? before.setpoint : PhaseValues{};
}

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

/// Whether a set-point changes faster than the rules allow, from the command before to this one.
bool is_too_steep(const Command& command, const CommandView& axis) noexcept {
  if (axis.rules.on_excess != OnExcess::kRefuse || axis.step <= 0.0) return false;
  const Command& before = axis.newest;
  const Tick ticks = before.answers < 0 ? 1 : command.answers - before.answers;
  return is_steeper(before.phases, command.phases, static_cast<double>(ticks) * axis.step);
}

}  // namespace

Refused judge(const Command& command, Owner sender, const CommandView& axis) noexcept {
  if (sender == 0 || sender != axis.owner) return Refused::kNotOwner;
  const Refused values = check_values(command.phases, axis.rules, axis.drive);
  if (values != Refused::kNot) return values;
  if (command.answers > axis.tick || command.answers <= axis.newest.answers) return Refused::kStale;
  if (is_too_steep(command, axis)) return Refused::kBeyondDrive;
  return axis.is_latched && command.phases.gates != Gates::kOff ? Refused::kLatched : Refused::kNot;
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
