#pragma once

// Of the guard that the tests preload (tests/adversity/guard): it ends a program that allocates, locks, waits
// or enters the kernel between the two. Nobody else has them.
extern "C" {
[[gnu::weak]] void drivebench_tick_begins() noexcept;
[[gnu::weak]] void drivebench_tick_ends() noexcept;
}

namespace drivebench {

/// As long as it lives nothing may be done that could wait.
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
