#pragma once

#include <atomic>
#include <chrono>

namespace drivebench {

/// The clock for timeouts and rate limits of the endpoints: the steady clock, or that of a simulation. Plant
/// time counts ticks instead.
class ServerClock {
 public:
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<ServerClock>;
  static constexpr bool is_steady = true;

  static time_point now() noexcept {
    const rep simulated = simulated_ns_.load(std::memory_order_relaxed);
    return time_point(simulated >= 0 ? duration(simulated)
                                     : duration(std::chrono::steady_clock::now().time_since_epoch()));
  }

  /// Sets the time, which stands still until the next call. Due timers expire at the next poll of their
  /// io_context after a timer has been set.
  static void simulate(time_point now) noexcept {
    simulated_ns_.store(now.time_since_epoch().count(), std::memory_order_relaxed);
  }

 private:
  inline static std::atomic<rep> simulated_ns_{-1};
};

}  // namespace drivebench
