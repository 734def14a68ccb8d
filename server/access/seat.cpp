#include "server/access/seat.hpp"

#include <utility>

namespace drivebench {

void Seat::ask(LeaseAction action, Owner number, Engine::Answer answer, const Client* from) {
  engine_.request({.tick = 0, .axis = axis_, .owner = number, .action = action},
                  answered(action, number, std::move(answer)), from);
}

void Seat::take(Owner number, const std::string& reason, Engine::Answer answer) {
  engine_.take(axis_, number, reason, answered(LeaseAction::kAcquire, number, std::move(answer)));
}

Engine::Answer Seat::answered(LeaseAction action, Owner number, Engine::Answer answer) {
  ++asking_;
  if (action == LeaseAction::kAcquire) ++acquiring_;
  return [this, action, number, answer = std::move(answer)](Refused refused, Tick tick) {
    --asking_;
    if (action == LeaseAction::kAcquire) --acquiring_;
    if (refused == Refused::kNot && action == LeaseAction::kAcquire) owner_ = number;
    if (refused == Refused::kNot && action == LeaseAction::kRelease) owner_ = 0;
    answer(refused, tick);
  };
}

void Seat::end(LeaseAction how, const Client* from) {
  const Owner owner = std::exchange(owner_, Owner{0});  // first: in lockstep the request may run a tick
  if (owner == 0) return;
  engine_.request(
      {.tick = 0, .axis = axis_, .owner = owner, .action = how}, [](Refused, Tick) {}, from);
}

bool Seat::notice_end() {
  if (owner_ == 0 || is_held()) return false;
  owner_ = 0;
  return true;
}

bool Seat::notice_taken(const Taken& taken) {
  if (taken.axis != axis_ || owner_ == 0 || taken.from != owner_) return false;
  owner_ = 0;
  return true;
}

}  // namespace drivebench
