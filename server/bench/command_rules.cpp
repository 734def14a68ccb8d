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
PhaseValues start_of(const PhaseCommand& before, Gates gates, Connection connection) noexcept {
  if (before.gates == gates) return before.setpoint;
  if (gates != Gates::kDuty || connection != Connection::kStar) return {};
  return {.a = 0.5, .b = 0.5, .c = 0.5, .field = 0.0};
}

bool is_beyond(const PhaseCommand& command, const CommandView& axis) noexcept {
  if (command.gates == Gates::kEdges) return std::abs(command.setpoint.field) > 1.0;
  if (command.gates == Gates::kDuty) return largest(parts_of_rail(axis.connection, command.setpoint)) > 1.0;
  const double limit = command.gates == Gates::kCurrent ? axis.drive.current_loop.limit_a
                                                        : axis.drive.amplifier.voltage_limit_v;
  return largest(command.setpoint) > limit;
}

Refused check_values(const PhaseCommand& command, const CommandView& axis) noexcept {
  if (!is_finite(command)) return Refused::kNotFinite;
  if (!suits(axis.drive.kind, command.gates)) return Refused::kWrongDrive;
  if (largest(command.setpoint) > kMaxSetpoint) return Refused::kBeyondDrive;
  if (command.gates == Gates::kEdges && !are_in_order(command.edges, axis.period_ns)) {
    return Refused::kBeyondDrive;
  }
  if (axis.rules.on_excess == OnExcess::kSaturate) return Refused::kNot;
  return is_beyond(command, axis) ? Refused::kBeyondDrive : Refused::kNot;
}

/// Whether a set-point changes faster than the rules allow, from the command before to this one.
bool is_too_steep(const Command& command, const CommandView& axis) noexcept {
  if (axis.rules.on_excess != OnExcess::kRefuse || axis.step <= 0.0) return false;
  const Command& before = axis.newest;
  const Tick ticks = before.answers < 0 ? 1 : command.answers - before.answers;
  return is_steeper(before.phases, command.phases,
                    largest_change(static_cast<double>(ticks) * axis.step, command.phases.gates,
                                   axis.connection, axis.drive));
}

}  // namespace

Refused judge(const Command& command, Owner sender, const CommandView& axis) noexcept {
  if (axis.takes_voltages) return Refused::kSharedAmplifier;
  if (sender == 0 || sender != axis.owner) return Refused::kNotOwner;
  const Refused values = check_values(command.phases, axis);
  if (values != Refused::kNot) return values;
  if (command.answers > axis.tick || command.answers <= axis.newest.answers) return Refused::kStale;
  if (is_too_steep(command, axis)) return Refused::kBeyondDrive;
  return axis.is_latched && command.phases.gates != Gates::kOff ? Refused::kLatched : Refused::kNot;
}

LargestChange largest_change(double step, Gates gates, Connection connection,
                             const DriveParameters& drive) noexcept {
  if (gates != Gates::kDuty) return {.step = step, .connection = connection};
  // Not the voltage of the link: a command must be judged alike before the tick and in it.
  const double supply_v = supply_voltage_v(drive.bus, drive.amplifier.voltage_limit_v, connection);
  return {.step = step / supply_v, .connection = connection};
}

bool is_steeper(const PhaseCommand& before, const PhaseCommand& command,
                const LargestChange& largest_change) noexcept {
  const PhaseValues from = start_of(before, command.gates, largest_change.connection);
  const auto difference = [](double a, double b) { return b - a; };
  return largest(by_terminal(difference, from, command.setpoint)) > largest_change.step;
}

PhaseCommand slewed(const PhaseCommand& before, const PhaseCommand& command,
                    const LargestChange& largest_change) noexcept {
  const PhaseValues from = start_of(before, command.gates, largest_change.connection);
  const double step = largest_change.step;
  const auto towards = [step](double a, double b) { return std::clamp(b, a - step, a + step); };
  return {.gates = command.gates,
          .legs_off = command.legs_off,
          .setpoint = by_terminal(towards, from, command.setpoint),
          .edges = command.edges};
}

}  // namespace drivebench
