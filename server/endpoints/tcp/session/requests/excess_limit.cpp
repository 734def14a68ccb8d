#include "server/endpoints/tcp/session/requests/excess_limit.hpp"

#include <algorithm>

namespace drivebench {

ExcessLimit::ExcessLimit(Dialogue& dialogue)
    : dialogue_(dialogue),
      allowance_({.at_once = kAtOnce,
                  .per_s = 1e9 / static_cast<double>(dialogue.engine().config().setup.period_ns)},
                 ServerClock::now()) {}

void ExcessLimit::charge() {
  if (dialogue_.engine().config().mode != RunMode::kRealtime) return;
  ++dialogue_.context().counts.excess_commands;
  allowance_.use();
}

ServerClock::duration ExcessLimit::pause() {
  if (!allowance_.is_overdrawn()) return {};
  const ServerClock::duration wait = allowance_.wait(ServerClock::now());
  if (wait == ServerClock::duration::zero()) return wait;
  if (dialogue_.context().counts.throttled++ % 1000 == 0) {
    dialogue_.report("limit", "throttled", "too many commands");
  }
  return std::min<ServerClock::duration>(wait, kLongestPause);
}

}  // namespace drivebench
