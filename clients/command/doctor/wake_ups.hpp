#pragma once

#include <cstdint>

namespace drivebench::command {

/// Of the tick thread, as a bench file has it by default.
inline constexpr int kTickPriority = 80;

/// How late a thread with an absolute deadline each millisecond woke up.
struct WakeUps {
  std::int64_t p50_ns = 0;
  std::int64_t p99_ns = 0;
  std::int64_t worst_ns = 0;
  std::int64_t late = 0;  ///< by a period of the bench
  std::int64_t count = 0;
  bool real_time = false;  ///< under SCHED_FIFO; else as an ordinary thread
};

/// Sleeps as the tick thread does, under SCHED_FIFO where permitted, for a time.
WakeUps measure_wake_ups(double duration_s, std::int64_t period_ns);

/// Of CLOCK_MONOTONIC.
std::int64_t clock_resolution_ns();

}  // namespace drivebench::command
