#pragma once

#include <atomic>
#include <cstdint>

#include "server/host/arithmetic.hpp"

namespace drivebench {

/// The messages between the tick thread and the supervisor.
class Watch {
 public:
  /// The arithmetic is checked once in a second of ticks.
  explicit Watch(std::int64_t period_ns) noexcept
      : look_ticks_(period_ns < 1'000'000'000 ? static_cast<std::uint32_t>(1'000'000'000 / period_ns) : 1) {}

  /// Tick thread, in each tick.
  void beat() noexcept {
    beats_.store(beats_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    if (until_look_-- != 0) return;
    until_look_ = look_ticks_ - 1;
    if (force_arithmetic()) arithmetic_resets_.fetch_add(1, std::memory_order_relaxed);
  }
  std::uint64_t beats() const noexcept { return beats_.load(std::memory_order_relaxed); }
  /// The number of times that the arithmetic was not as declared.
  std::uint64_t arithmetic_resets() const noexcept {
    return arithmetic_resets_.load(std::memory_order_relaxed);
  }

  /// Supervisor: the I/O thread stands still, so that no command can arrive.
  void abandon() noexcept { abandoned_.store(true, std::memory_order_relaxed); }
  /// Tick thread: whether abandon() was called since the last time.
  bool take_abandoned() noexcept {
    if (!abandoned_.load(std::memory_order_relaxed)) return false;
    return abandoned_.exchange(false, std::memory_order_relaxed);
  }

 private:
  std::uint32_t look_ticks_;
  std::uint32_t until_look_ = 0;
  std::atomic<std::uint64_t> beats_{0};
  std::atomic<std::uint64_t> arithmetic_resets_{0};
  std::atomic<bool> abandoned_{false};
};

}  // namespace drivebench
