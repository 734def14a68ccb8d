#pragma once

#include <chrono>
#include <cstdint>

#include "server/host/clock.hpp"

namespace drivebench {

/// At most one log line per 10 s from one source; counts the lines that it holds back.
class LogLimit {
 public:
  /// Whether to log now. If so, held_back() is the number of lines held back since the last one.
  bool allow() noexcept {
    const auto now = ServerClock::now();
    if (last_ != Time{} && now - last_ < std::chrono::seconds(10)) {
      ++pending_;
      return false;
    }
    last_ = now;
    held_back_ = pending_;
    pending_ = 0;
    return true;
  }
  std::uint64_t held_back() const noexcept { return held_back_; }

 private:
  using Time = ServerClock::time_point;
  Time last_{};
  std::uint64_t pending_ = 0;
  std::uint64_t held_back_ = 0;
};

}  // namespace drivebench
