#include "server/pacing/tick_clock.hpp"

namespace drivebench {

void TickClock::wait_for_tick() noexcept {
  lateness_ns_ = pacer_->wait();
  if (!is_realtime_) return;
  lateness_.add(lateness_ns_);
  worst_ns_.store(lateness_.worst_ns(), std::memory_order_relaxed);
  if (lateness_ns_ > max_lateness_ns_)
    pacer_->resynchronise();  // it asks for the time, which a tick must not
}

void TickClock::report_lateness(Bench& bench) noexcept {
  if (!is_realtime_) return;
  if (lateness_ns_ > max_lateness_ns_) {
    bench.submit({.tick = bench.tick(), .axis = 0, .owner = 0, .action = Overrun{}});
  } else if (lateness_ns_ >= period_ns_) {
    bench.submit({.tick = bench.tick(), .axis = 0, .owner = 0, .action = LateTick{}});
  }
}

}  // namespace drivebench
