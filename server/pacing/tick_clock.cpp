#include "server/pacing/tick_clock.hpp"

namespace drivebench {

void TickClock::wait_for_tick() noexcept {
  lateness_ns_ = pacer_->wait();
  if (!is_realtime_) return;
  lateness_.add(lateness_ns_);
  if (lateness_ns_ > max_lateness_ns_) begin_anew();  // it asks for the time, which a tick must not
  has_begun_ = std::exchange(begins_, false);
}

std::optional<TimeBase> TickClock::new_time_base(Tick tick) const noexcept {
  if (!has_begun_ || pacer_->due_unix_ns() == 0) return std::nullopt;
  return TimeBase{.since_tick = static_cast<std::uint64_t>(tick),
                  .epoch_unix_ns = pacer_->due_unix_ns() - (tick + 1) * period_ns_};
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
