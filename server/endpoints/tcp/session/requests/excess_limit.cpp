#include "server/endpoints/tcp/session/requests/excess_limit.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace drivebench {

void ExcessLimit::charge() {
  if (dialogue_.engine().config().mode != RunMode::kRealtime) return;
  refill();
  ++dialogue_.context().counts.excess_commands;
  left_ -= 1.0;
}

void ExcessLimit::refill() {
  const ServerClock::time_point now = ServerClock::now();
  const auto elapsed = now - std::exchange(refilled_, now);
  const auto ticks =
      static_cast<double>(elapsed.count()) / static_cast<double>(dialogue_.engine().config().setup.period_ns);
  left_ = std::min(left_ + ticks, kAtOnce);
}

ServerClock::duration ExcessLimit::pause() {
  if (left_ >= 0.0) return {};
  refill();
  if (left_ >= 0.0) return {};
  if (dialogue_.context().counts.throttled++ % 1000 == 0) {
    dialogue_.report("limit", "throttled", "too many commands");
  }
  const double pause_ns = -left_ * static_cast<double>(dialogue_.engine().config().setup.period_ns);
  return std::min<ServerClock::duration>(std::chrono::nanoseconds(static_cast<std::int64_t>(pause_ns)),
                                         kLongestPause);
}

}  // namespace drivebench
