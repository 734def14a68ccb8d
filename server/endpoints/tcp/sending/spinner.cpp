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

void Spinner::leave(Door& door) {
  std::replace(doors_.begin(), doors_.end(), &door, static_cast<Door*>(nullptr));
}

void Spinner::take_turn() {
  Clock::time_point now = Clock::now();
  for (const Clock::time_point end = now + kTurn; now < end && !doors_.empty(); now = Clock::now()) {
    if (next_ >= doors_.size()) {
      std::erase(doors_, nullptr);
      next_ = 0;
      shm::spin();
      continue;
    }
    const std::size_t n = next_++;  // an index: a look may bring other doors
    if (doors_[n] != nullptr && !doors_[n]->look(now)) doors_[n] = nullptr;
  }
  turn_to_come_ = !doors_.empty();
  if (turn_to_come_) asio::post(io_, [this] { take_turn(); });
}

}  // namespace drivebench
