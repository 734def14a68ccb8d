#include "server/pacing/tick_clock.hpp"

namespace drivebench {

void TickClock::wait_for_tick(Bench& bench) noexcept {
  const std::int64_t lateness_ns = pacer_->wait();
  if (!is_realtime_) return;
  lateness_.add(lateness_ns);
  worst_ns_.store(lateness_.worst_ns(), std::memory_order_relaxed);
  if (lateness_ns > max_lateness_ns_) {
    bench.submit({.tick = bench.tick(), .axis = 0, .owner = 0, .action = Overrun{}});
    pacer_->resynchronise();
  } else if (lateness_ns >= period_ns_) {
    bench.submit({.tick = bench.tick(), .axis = 0, .owner = 0, .action = LateTick{}});
  }
}

}  // namespace drivebench
