#include "server/endpoints/tcp/session/requests/leases.hpp"

#include <algorithm>

#include "protocols/text.hpp"

namespace drivebench {

Leases::Leases(Dialogue& dialogue)
    : dialogue_(dialogue), engine_(dialogue.engine()), taken_(dialogue.axis_count()) {
  for (std::uint32_t axis = 0; axis < dialogue.axis_count(); ++axis)
    seats_.emplace_back(engine_, axis);
}

void Leases::lease(const v1::LeaseRequest& r) {
  if (!dialogue_.axis_exists(r.axis())) return;
  const bool takes = r.action() == v1::LeaseRequest::ACTION_TAKE;
  if (!takes &&
      (r.action() < v1::LeaseRequest::ACTION_ACQUIRE || r.action() > v1::LeaseRequest::ACTION_RELEASE)) {
    return dialogue_.refuse(dialogue_.id(), v1::REFUSAL_OUT_OF_RANGE,
                            "the action must be acquire, renew, release or take", "action");
  }
  if (engine_.config().mode == RunMode::kFree) {
    return dialogue_.refuse(dialogue_.id(), Refused::kWrongMode, "action");
  }
  const auto action = takes ? LeaseAction::kAcquire : static_cast<LeaseAction>(r.action());
  const auto on_done = [this, axis = r.axis()] {
    taken_[axis].clear();
    if (seats_[axis].owner() == 0) on_gone(axis);
    if (over_) lose_all();  // the peer left before the bench answered
  };
  Engine::Answer answer = answer_for(r.axis(), "axis", on_done);
  if (takes) return take(r, std::move(answer));
  if (dialogue_.owner() == 0 && action == LeaseAction::kAcquire) {
    dialogue_.set_owner(seats_[r.axis()].number_for(dialogue_.client()));
  }
  seats_[r.axis()].ask(action, dialogue_.owner(), std::move(answer), &dialogue_.client());
}

void Leases::take(const v1::LeaseRequest& r, Engine::Answer answer) {
  constexpr std::size_t kMaxReason = 200;
  if (r.reason().empty() || r.reason().size() > kMaxReason) {
    return dialogue_.refuse(dialogue_.id(), v1::REFUSAL_OUT_OF_RANGE,
                            "taking an axis by force needs a reason of 1 to 200 bytes, not of " +
                                std::to_string(r.reason().size()),
                            "reason");
  }
  if (!is_plain(r.reason())) {
    return dialogue_.refuse(dialogue_.id(), v1::REFUSAL_OUT_OF_RANGE,
                            "the reason is \"" + printable(r.reason()) +
                                "\" but may hold no control characters and no changes of direction",
                            "reason");
  }
  // A new owner has a larger number than the owner before, so that the numbers show the order.
  const bool may_hold = std::any_of(seats_.begin(), seats_.end(),
                                    [](const Seat& seat) { return seat.is_asking() || seat.owner() != 0; });
  if (dialogue_.owner() == 0 || !may_hold) dialogue_.set_owner(engine_.new_owner(dialogue_.client()));
  seats_[r.axis()].take(dialogue_.owner(), r.reason(), std::move(answer));
}

void Leases::on_taken(const Taken& taken) {
  if (!seats_[taken.axis].notice_taken(taken)) return;
  const Client* const by = engine_.client(taken.by);
  const std::string sentence = "axis " + std::to_string(taken.axis) + " was taken by " +
                               (by == nullptr ? "an administrator" : name_of(*by)) + ": " + taken.reason;
  taken_[taken.axis] = sentence;
  dialogue_.notify(v1::Notice::KIND_LEASE_TAKEN, sentence, taken.axis);
  on_gone(taken.axis);
}

void Leases::lose_all() {
  over_ = true;
  for (Seat& seat : seats_)
    seat.lose(&dialogue_.client());
}

bool Leases::may_change(std::uint32_t axis) {
  if (!dialogue_.axis_exists(axis)) return false;
  if (engine_.config().mode == RunMode::kFree || dialogue_.conducts() || sender(axis) != 0) return true;
  dialogue_.refuse(dialogue_.id(), Refused::kNotOwner, "axis");
  return false;
}

bool Leases::has_bench_to_itself() {
  if (dialogue_.conducts()) return true;
  for (std::uint32_t axis = 0; axis < dialogue_.axis_count(); ++axis) {
    if (engine_.owner(axis) == 0 || sender(axis) != 0) continue;
    refuse_owned(dialogue_.id(), axis);
    return false;
  }
  return true;
}

Owner Leases::sender(std::uint32_t axis) const {
  const Owner owner = dialogue_.owner();
  return owner == engine_.owner(axis) ? owner : 0;
}

std::string Leases::not_owner_of(std::uint32_t axis) const {
  const std::string sentence(sentence_of(Refused::kNotOwner));
  return taken_[axis].empty() ? sentence : sentence + ": " + taken_[axis];
}

void Leases::ask(const Input& input, const char* field) {
  engine_.request(input, answer_for(input.axis, field, nullptr), &dialogue_.client());
}

Engine::Answer Leases::answer_for(std::uint32_t axis, const char* field, std::function<void()> on_done) {
  return [this, session = dialogue_.keep_alive(), id = dialogue_.id(), axis, field,
          on_done = std::move(on_done)](Refused refused, Tick tick) {
    if (refused == Refused::kOwned) return refuse_owned(id, axis);
    if (refused != Refused::kNot) {
      return dialogue_.refuse(id, refused, engine_.sentence_of(refused, axis), field);
    }
    if (on_done) on_done();
    dialogue_.done(id, tick);
  };
}

/// Names the holder of the axis. The holder may have renewed the lease in this tick, which is not known yet,
/// so the sentence gives the latest possible end.
void Leases::refuse_owned(std::uint64_t id, std::uint32_t axis) {
  dialogue_.note_not_owner(Refused::kOwned);
  const Client* const holder = engine_.client(engine_.owner(axis));
  const std::string name = holder == nullptr ? "another client" : name_of(*holder);
  const Tick end = engine_.tick() + engine_.config().setup.lease_ticks;
  v1::Refusal& refusal = *dialogue_.begin_reply(id).mutable_refusal();
  refusal.set_code(v1::REFUSAL_OWNED);
  refusal.set_message(std::string(sentence_of(Refused::kOwned)) + ": " + name + ", until tick " +
                      std::to_string(end) + " at the latest unless it is renewed");
  refusal.set_field("axis");
  refusal.set_holder(name);
  refusal.set_lease_end_tick(static_cast<std::uint64_t>(end));
  dialogue_.send_reply();
}

}  // namespace drivebench
