#include "server/endpoints/tcp/session/requests/exchanges.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "server/recording/input_codec.hpp"

namespace drivebench {

Exchanges::Exchanges(Dialogue& dialogue, const Leases& leases, Subscriptions& subscriptions)
    : dialogue_(dialogue),
      engine_(dialogue.engine()),
      leases_(leases),
      subscriptions_(subscriptions),
      excess_(dialogue) {}

void Exchanges::exchange(const v1::Exchange& r) {
  const std::uint64_t id = dialogue_.id();
  if (waiting_) {
    excess_.charge();
    return dialogue_.refuse(id, v1::REFUSAL_BUSY, "an exchange of this session is still waiting for its tick",
                            "commands");
  }
  if (r.commands().empty()) {
    std::vector<std::uint32_t> all(dialogue_.axis_count());
    std::iota(all.begin(), all.end(), 0u);
    return reply(id, all);
  }
  std::optional<std::vector<std::uint32_t>> axes = axes_of(r);
  if (!axes || !are_taken(r)) return;
  add_shared(*axes);
  waiting_ = Waiting{.id = id, .axes = std::move(*axes)};
  dialogue_.context().audience.add_waiting(*this);
  engine_.advance();
}

std::optional<std::vector<std::uint32_t>> Exchanges::axes_of(const v1::Exchange& r) {
  std::vector<std::uint32_t> axes;
  for (const v1::Command& command : r.commands()) {
    if (!dialogue_.axis_exists(command.axis())) return std::nullopt;
    if (std::find(axes.begin(), axes.end(), command.axis()) != axes.end()) {
      dialogue_.refuse(dialogue_.id(), v1::REFUSAL_OUT_OF_RANGE, "two commands for one axis",
                       "commands.axis");
      return std::nullopt;
    }
    if (!decode_command(command)) {
      const bool gates = !v1::Gates_IsValid(command.gates());
      dialogue_.refuse(dialogue_.id(), v1::REFUSAL_OUT_OF_RANGE,
                       gates ? "gates is " + std::to_string(command.gates()) + " but must be 0 to 4"
                             : "legs_off is " + std::to_string(command.legs_off()) + " but must be 0 to 7",
                       gates ? "commands.gates" : "commands.legs_off");
      return std::nullopt;
    }
    axes.push_back(command.axis());
  }
  return axes;
}

/// Gives the bench all commands or none: after an accepted command its axis would refuse the next try.
bool Exchanges::are_taken(const v1::Exchange& r) {
  const Owner owner = dialogue_.owner();
  for (const v1::Command& command : r.commands()) {
    if (engine_.check(command.axis(), owner, *decode_command(command)) == Refused::kNot) continue;
    const Refused why = engine_.command(command.axis(), owner, *decode_command(command));
    excess_.charge();
    if (lacks_lease(why)) dialogue_.note_not_owner(why);
    const std::string sentence = why == Refused::kNotOwner ? leases_.not_owner_of(command.axis())
                                                           : engine_.sentence_of(why, command.axis());
    dialogue_.refuse(dialogue_.id(), code_of(why),
                     sentence + " (axis " + std::to_string(command.axis()) + ")",
                     why == Refused::kWrongDrive ? "commands.gates" : "commands");
    return false;
  }
  for (const v1::Command& command : r.commands())
    engine_.command(command.axis(), owner, *decode_command(command));
  return true;
}

/// The answer has the samples of all axes that the commands drive.
void Exchanges::add_shared(std::vector<std::uint32_t>& axes) const {
  const std::vector<AxisSetup>& all = engine_.config().setup.axes;
  for (std::uint32_t axis = 0; axis < all.size(); ++axis) {
    const auto other = all[axis].shares_amplifier_with;
    if (other && std::find(axes.begin(), axes.end(), *other) != axes.end()) axes.push_back(axis);
  }
}

void Exchanges::on_newest() {
  if (!waiting_) return;
  const Waiting waiting = std::move(*waiting_);
  waiting_.reset();
  reply(waiting.id, waiting.axes);
}

void Exchanges::abandon(std::uint32_t axis) {
  if (!waiting_ || std::find(waiting_->axes.begin(), waiting_->axes.end(), axis) == waiting_->axes.end())
    return;
  const std::uint64_t id = waiting_->id;
  waiting_.reset();
  dialogue_.refuse(id, v1::REFUSAL_NOT_OWNER, leases_.not_owner_of(axis), "commands");
}

void Exchanges::reply(std::uint64_t id, std::span<const std::uint32_t> axes) {
  subscriptions_.send_samples();  // the samples of a tick come before the answer with that tick
  views_.clear();
  for (const std::uint32_t axis : axes)
    views_.push_back({axis, &engine_.newest(axis)});
  dialogue_.scratch().clear();
  append_exchange_reply(dialogue_.scratch(), id, views_);
  dialogue_.send_scratch();
}

}  // namespace drivebench
