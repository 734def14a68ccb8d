#include "server/bench/safe_action.hpp"

#include <algorithm>
#include <numbers>

#include "plant/drive/phases.hpp"
#include "plant/math/frames.hpp"
#include "plant/math/trig.hpp"

namespace drivebench {
namespace {

/// The number of commands in the mean of the frequency: enough for the six steps of block commutation, and
/// short compared with a ramp.
constexpr std::int64_t kMeanCommands = 64;

TwoPhase vector_of(const PhaseValues& x, Connection connection) noexcept {
  if (connection == Connection::kTwoPhase) return {.a = x.a, .b = x.b};
  return three_to_two(phases_of(x));
}

double turned_between(double from_rad, double to_rad) noexcept {
  const double turn_rad = to_rad - from_rad;
  if (turn_rad > std::numbers::pi) return turn_rad - 2.0 * std::numbers::pi;
  return turn_rad < -std::numbers::pi ? turn_rad + 2.0 * std::numbers::pi : turn_rad;
}

/// The set-points turned by an angle; those of three phases have `common` as their common part.
PhaseValues turned(const PhaseValues& x, double angle_rad, Connection connection, double common) noexcept {
  if (connection == Connection::kArmature) return x;
  const CosSin by = cos_sin(angle_rad);
  const TwoPhase v = vector_of(x, connection);
  const TwoPhase w = to_ab({.d = v.a, .q = v.b}, by);
  if (connection == Connection::kTwoPhase) return {.a = w.a, .b = w.b, .c = 0.0, .field = x.field};
  const ThreePhase phases = two_to_three(w);
  return {.a = phases.a + common, .b = phases.b + common, .c = phases.c + common, .field = x.field};
}

/// Constant deceleration: after m of n ticks the frequency is 1 - m/n of its start. The field winding keeps
/// its set-point, so that an armature brakes. All legs are on: a leg that was off belongs to one position of
/// the rotor. The duties of a star get half for their common part, so that no leg comes to a rail on its way.
PhaseCommand ramp_down(const LastCommands& last, Connection connection, Tick ramp_ticks) noexcept {
  if (last.gone >= ramp_ticks || last.command.gates == Gates::kEdges) return {};  // edges have no angle
  const auto m = static_cast<double>(last.gone);
  const double part = m / static_cast<double>(ramp_ticks);
  PhaseCommand command = last.command;
  command.legs_off = 0;
  const bool star_duties = command.gates == Gates::kDuty && connection == Connection::kStar;
  const double common = star_duties ? 0.0 : neutral(phases_of(last.command.setpoint));
  command.setpoint =
      turned(last.command.setpoint, last.turn_rad_per_tick * m * (1.0 - 0.5 * part), connection, common);
  command.setpoint.a *= 1.0 - part;
  command.setpoint.b *= 1.0 - part;
  command.setpoint.c *= 1.0 - part;
  if (star_duties) {
    command.setpoint.a += 0.5;
    command.setpoint.b += 0.5;
    command.setpoint.c += 0.5;
  }
  return command;
}

}  // namespace

void follow(LastCommands& last, const PhaseCommand& command, Connection connection, bool turns) noexcept {
  last.gone = 0;
  last.command = command;
  if (!turns || connection == Connection::kArmature) return;
  const TwoPhase v = vector_of(command.setpoint, connection);
  if (v.a == 0.0 && v.b == 0.0) return;  // no angle
  const double angle_rad = arctangent2(v.b, v.a);
  if (last.followed > 0) {
    const double turn_rad = turned_between(last.angle_rad, angle_rad);
    last.turn_rad_per_tick +=
        (turn_rad - last.turn_rad_per_tick) / static_cast<double>(std::min(last.followed, kMeanCommands));
  }
  last.angle_rad = angle_rad;
  ++last.followed;
}

PhaseCommand in_force(const LastCommands& last, SafeAction action, Connection connection,
                      Tick quick_stop_ticks) noexcept {
  if (last.gone == 0 || action == SafeAction::kHold) return last.command;
  if (action == SafeAction::kZeroVoltage) return {.gates = Gates::kZeroVoltage, .setpoint = {}};
  if (action == SafeAction::kFreewheel) return {};
  return ramp_down(last, connection, quick_stop_ticks);
}

PhaseCommand act_safely(LastCommands& last, SafeAction action, bool faulty, Connection connection,
                        Tick quick_stop_ticks) noexcept {
  ++last.gone;
  const bool ends = faulty && action != SafeAction::kZeroVoltage;
  return in_force(last, ends ? SafeAction::kFreewheel : action, connection, quick_stop_ticks);
}

}  // namespace drivebench
