#pragma once

// The guard that tests preload (tests/adversity/guard) defines these two, and ends a program that allocates,
// locks, waits or enters the kernel between them. Without the guard they are null.
extern "C" {
[[gnu::weak]] void drivebench_tick_begins() noexcept;
[[gnu::weak]] void drivebench_tick_ends() noexcept;
}

namespace drivebench {

/// During its lifetime the thread must do nothing that could wait.
class TickMark {
 public:
  TickMark() noexcept {
    if (drivebench_tick_begins != nullptr) drivebench_tick_begins();
  }
  ~TickMark() {
    if (drivebench_tick_ends != nullptr) drivebench_tick_ends();
  }
  TickMark(const TickMark&) = delete;
  TickMark& operator=(const TickMark&) = delete;
};

}  // namespace drivebench
