#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <limits>

/// Waiting for a word in memory that two programs share.
namespace drivebench::shm {

/// Sleeps until the other program wakes the word or the time is over; not at all if the word has another
/// value.
inline void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value,
                        std::chrono::nanoseconds most) noexcept {
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(most);
  const timespec wait{.tv_sec = whole.count(), .tv_nsec = (most - whole).count()};
  ::syscall(SYS_futex, &word, FUTEX_WAIT, value, &wait, nullptr, 0);
}

/// Wakes all that sleep on the word.
inline void wake(const std::atomic<std::uint32_t>& word) noexcept {
  ::syscall(SYS_futex, &word, FUTEX_WAKE, std::numeric_limits<int>::max(), nullptr, nullptr, 0);
}

}  // namespace drivebench::shm
