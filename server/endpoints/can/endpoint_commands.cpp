// Takes or refuses commands.
#include "server/endpoints/can/endpoint.hpp"

namespace drivebench::can {
namespace {

constexpr unsigned kLastMode = kLegDutyMode;

constexpr bool has_duties(unsigned mode) noexcept {
  return mode == kDutyMode || mode == kLegDutyMode;
}

/// Whether a command in this mode has set-points.
constexpr bool has_setpoints(unsigned mode) noexcept {
  return mode == static_cast<unsigned>(Gates::kVoltage) || mode == kCurrentMode || has_duties(mode);
}

Gates gates_of(unsigned mode) noexcept {
  if (mode == kCurrentMode) return Gates::kCurrent;
  return has_duties(mode) ? Gates::kDuty : static_cast<Gates>(mode);
}

}  // namespace

/// Whether the node has this frame: on a bus with wide axes match() also finds frames that a narrow axis
/// lacks.
bool Endpoint::is_for(const Node& node, const MessageRow& row) {
  if (row.width != Width::kWide || node.wide()) return true;
  const bool has_narrow = find_message(row.message, config_.profile.fd) != nullptr;
  ++problems_[static_cast<std::size_t>(has_narrow ? FrameProblem::kWrongSize : FrameProblem::kForeign)];
  return false;
}

Tick Endpoint::answered_by(const Node& node, const MessageRow& row, const CommandFields& given) const {
  const Field& tick = row.fields[index_of(row, "tick")];
  return unwrap(given.tick, tick.bits, static_cast<std::int64_t>(engine_->newest(node.axis).tick));
}

void Endpoint::on_phase_command(Node& node, const MessageRow& row, const Values& values) {
  const CommandFields given = setpoints_in(row, values);
  // Ignored without the lease: the command that follows is refused and answered.
  if (node.seat.owner() == 0 || given.lease != node.lease) return;
  node.spoke = true;
  node.phases = {
      .answers = answered_by(node, row, given), .mode = given.mode, .c = given.c, .field = given.field};
}

void Endpoint::on_command(Node& node, const MessageRow& row, const Values& values) {
  ++commands_;
  CommandFields given = setpoints_in(row, values);
  const Tick answers = answered_by(node, row, given);
  // 0: without the lease the bench refuses the command.
  const Owner owner = given.lease == node.lease ? node.seat.owner() : 0;
  if (owner != 0) node.spoke = true;
  if (given.mode > kLastMode) {
    return refuse(node, owner, Refused::kMalformed, given, "its mode must be 0 to 5");
  }
  if (given.legs_off > kAllLegs) {
    return refuse(node, owner, Refused::kMalformed, given, "its legs_off must be 0 to 7");
  }
  const bool is_whole = row.width == Width::kWide || !node.terminals.has_more() || !has_setpoints(given.mode);
  if (!is_whole && node.phases.answers == answers && node.phases.mode == given.mode) {
    given.c = node.phases.c;
    given.field = node.phases.field;
  } else if (!is_whole && owner != 0) {
    return refuse(node, owner, Refused::kIncomplete, given);
  }

  const PhaseValues setpoint{.a = given.a, .b = given.b, .c = given.c, .field = given.field};
  const Command command{
      .answers = answers,
      .phases = {
          .gates = gates_of(given.mode),
          .legs_off = given.legs_off,
          .setpoint = given.mode == kDutyMode ? node.terminals.duties_from_middle(setpoint) : setpoint}};
  const Refused why = engine_->command(node.axis, owner, command);
  if (why != Refused::kNot) {
    ++refused_;
    log_refusal(node, "a command", engine_->sentence_of(why, node.axis));
    return reply(node, Request::kCommand, why, 0, static_cast<std::uint8_t>(given.lease), answers);
  }
  node.commanded_at = engine_->tick();
  engine_->advance();
}

void Endpoint::refuse(const Node& node, Owner sender, Refused refused, const CommandFields& given,
                      std::string_view why) {
  if (why.empty()) why = sentence_of(refused);
  ++refused_;
  if (sender != 0) {
    engine_->request({.tick = 0, .axis = node.axis, .owner = sender, .action = RefusedCommand{true}},
                     [](Refused, Tick) {});
  }
  log_refusal(node, "a command", why);
  reply(node, Request::kCommand, refused, 0, static_cast<std::uint8_t>(given.lease),
        static_cast<std::int64_t>(given.tick));
}

}  // namespace drivebench::can
