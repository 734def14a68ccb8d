#include "server/endpoints/tcp/session/requests/exchanges.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "protocols/leg_edges.hpp"
#include "server/recording/input_codec.hpp"

namespace drivebench {

void Exchanges::Frames::answer(std::uint64_t id, std::span<const AxisSampleView> samples) {
  dialogue_.scratch().clear();
  append_exchange_reply(dialogue_.scratch(), id, samples);
  dialogue_.send_scratch();
}

void Exchanges::Frames::refuse(std::uint64_t id, v1::RefusalCode code, const std::string& sentence,
                               const char* field) {
  dialogue_.refuse(id, code, sentence, field);
}

Exchanges::Exchanges(Dialogue& dialogue, const Leases& leases, Subscriptions& subscriptions)
    : dialogue_(dialogue),
      engine_(dialogue.engine()),
      leases_(leases),
      subscriptions_(subscriptions),
      frames_(dialogue),
      excess_(dialogue) {}

void Exchanges::exchange(const v1::Exchange& r) {
  frame_.clear();
  for (const v1::Command& command : r.commands()) {
    frame_.push_back({.axis = command.axis(),
                      .tick = command.tick(),
                      .gates = command.gates(),
                      .legs_off = command.legs_off(),
                      .setpoint = setpoint_of(command),
                      .edges = {}});
    if (command.gates() != v1::GATES_EDGES) continue;
    if (const EdgeProblem problem = read_edges(command, frame_.back().edges); !problem.sentence.empty()) {
      return dialogue_.refuse(dialogue_.id(), v1::REFUSAL_OUT_OF_RANGE, problem.sentence,
                              problem.field.c_str());
    }
  }
  exchange(frame_, frames_, dialogue_.id());
}

void Exchanges::exchange(std::span<const shm::CommandRecord> commands, Way& way, std::uint64_t id) {
  if (waiting_) {
    excess_.charge();
    return way.refuse(id, v1::REFUSAL_BUSY, "an exchange of this session is still waiting for its tick",
                      "commands");
  }
  if (commands.empty()) {
    axes_.resize(dialogue_.axis_count());
    std::iota(axes_.begin(), axes_.end(), 0u);
    return answer(way, id);
  }
  const ServerClock::time_point arrived = ServerClock::now();
  if (!read(commands, way, id) || !are_taken(way, id)) return;
  add_shared();
  waiting_ = Waiting{.way = &way, .id = id, .since = arrived};
  dialogue_.context().audience.add_waiting(*this);
  engine_.advance();
}

bool Exchanges::read(std::span<const shm::CommandRecord> sent, Way& way, std::uint64_t id) {
  commands_.clear();
  axes_.clear();
  for (const shm::CommandRecord& record : sent) {
    if (record.axis >= dialogue_.axis_count()) {
      way.refuse(id, v1::REFUSAL_UNKNOWN_AXIS, dialogue_.no_such_axis(record.axis), "axis");
      return false;
    }
    const auto axis = static_cast<std::uint32_t>(record.axis);
    if (std::find(axes_.begin(), axes_.end(), axis) != axes_.end()) {
      way.refuse(id, v1::REFUSAL_OUT_OF_RANGE, "two commands for one axis", "commands.axis");
      return false;
    }
    if (record.gates < 0 || record.gates > static_cast<std::int64_t>(Gates::kEdges)) {
      way.refuse(id, v1::REFUSAL_OUT_OF_RANGE,
                 "gates is " + std::to_string(record.gates) + " but must be 0 to 5", "commands.gates");
      return false;
    }
    if (record.legs_off > kAllLegs) {
      way.refuse(id, v1::REFUSAL_OUT_OF_RANGE,
                 "legs_off is " + std::to_string(record.legs_off) + " but must be 0 to 7",
                 "commands.legs_off");
      return false;
    }
    const bool has_edges = record.gates == static_cast<std::int64_t>(Gates::kEdges);
    if (has_edges) {
      const EdgeProblem problem = problem_with(record.edges, engine_.config().setup.period_ns);
      if (!problem.sentence.empty()) {
        way.refuse(id, v1::REFUSAL_OUT_OF_RANGE, problem.sentence, problem.field.c_str());
        return false;
      }
    }
    axes_.push_back(axis);
    commands_.push_back({.axis = axis,
                         .command = {.answers = static_cast<Tick>(record.tick),
                                     .phases = {.gates = static_cast<Gates>(record.gates),
                                                .legs_off = static_cast<std::uint32_t>(record.legs_off),
                                                .setpoint = record.setpoint,
                                                .edges = has_edges ? leg_edges(record.edges) : LegEdges{}}}});
  }
  return true;
}

/// Gives the bench all commands or none: after an accepted command its axis would refuse the next try.
bool Exchanges::are_taken(Way& way, std::uint64_t id) {
  const Owner owner = dialogue_.owner();
  for (const AxisCommand& each : commands_) {
    if (engine_.check(each.axis, owner, each.command) == Refused::kNot) continue;
    const Refused why = engine_.command(each.axis, owner, each.command);
    excess_.charge();
    if (lacks_lease(why)) dialogue_.note_not_owner(why);
    const std::string sentence =
        why == Refused::kNotOwner ? leases_.not_owner_of(each.axis) : engine_.sentence_of(why, each.axis);
    way.refuse(id, code_of(why), sentence + " (axis " + std::to_string(each.axis) + ")",
               why == Refused::kWrongDrive ? "commands.gates" : "commands");
    return false;
  }
  for (const AxisCommand& each : commands_)
    engine_.command(each.axis, owner, each.command);
  return true;
}

/// The answer has the samples of all axes that the commands drive.
void Exchanges::add_shared() {
  const std::vector<AxisSetup>& all = engine_.config().setup.axes;
  for (std::uint32_t axis = 0; axis < all.size(); ++axis) {
    const auto other = all[axis].shares_amplifier_with;
    if (other && std::find(axes_.begin(), axes_.end(), *other) != axes_.end()) axes_.push_back(axis);
  }
}

void Exchanges::on_newest() {
  if (!waiting_) return;
  const Waiting waiting = *std::exchange(waiting_, std::nullopt);
  answer(*waiting.way, waiting.id);
  dialogue_.context().exchange_times.add((ServerClock::now() - waiting.since).count());
}

void Exchanges::abandon(std::uint32_t axis) {
  if (!waiting_ || std::find(axes_.begin(), axes_.end(), axis) == axes_.end()) return;
  const Waiting waiting = *std::exchange(waiting_, std::nullopt);
  waiting.way->refuse(waiting.id, v1::REFUSAL_NOT_OWNER, leases_.not_owner_of(axis), "commands");
}

void Exchanges::answer(Way& way, std::uint64_t id) {
  subscriptions_.send_samples();  // the samples of a tick come before the answer with that tick
  views_.clear();
  for (const std::uint32_t axis : axes_)
    views_.push_back({axis, &engine_.newest(axis)});
  way.answer(id, views_);
}

}  // namespace drivebench
