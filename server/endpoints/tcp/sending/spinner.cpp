#include "server/endpoints/tcp/sending/spinner.hpp"

#include <algorithm>
#include <utility>

#include "protocols/shm/segment.hpp"

namespace drivebench {

void Spinner::watch(Door& door) {
  if (std::find(doors_.begin(), doors_.end(), &door) == doors_.end()) doors_.push_back(&door);
  if (std::exchange(turn_to_come_, true)) return;
  asio::post(io_, [this] { take_turn(); });
}

void Spinner::leave(const Door& door) {
  std::replace(doors_.begin(), doors_.end(), const_cast<Door*>(&door), static_cast<Door*>(nullptr));
}

void Spinner::take_turn() {
  const Clock::time_point end = Clock::now() + kTurn;
  for (Clock::time_point now = end - kTurn; now < end && !doors_.empty(); now = Clock::now()) {
    // By index: serving a door may bring others, or make some leave.
    for (std::size_t i = 0; i < doors_.size(); ++i) {
      if (doors_[i] != nullptr && !doors_[i]->look(now)) doors_[i] = nullptr;
    }
    std::erase(doors_, nullptr);
    shm::spin();
  }
  turn_to_come_ = !doors_.empty();
  if (turn_to_come_) asio::post(io_, [this] { take_turn(); });
}

}  // namespace drivebench
