#pragma once

#include <algorithm>
#include <chrono>

#include "server/host/clock.hpp"

namespace drivebench {

/// A limit on an event: so many at once, and so many more with each second.
class Allowance {
 public:
  using Time = ServerClock::time_point;

  struct Rate {
    double at_once;
    double per_s;
  };

  Allowance(const Rate& rate, Time now) noexcept : rate_(rate), left_(rate.at_once), at_(now) {}

  /// The rest; negative: so many were used beyond it.
  double left(Time now) noexcept {
    const double elapsed_s = std::chrono::duration<double>(now - at_).count();
    left_ = std::min(left_ + rate_.per_s * elapsed_s, rate_.at_once);
    at_ = now;
    return left_;
  }
  void use() noexcept { left_ -= 1.0; }
  /// Whether more than was left has been used, as far as is known without the time.
  bool is_overdrawn() const noexcept { return left_ < 0.0; }
  /// The time until none are used beyond it.
  ServerClock::duration wait(Time now) noexcept {
    const double missing_s = std::max(-left(now), 0.0) / rate_.per_s;
    return std::chrono::duration_cast<ServerClock::duration>(std::chrono::duration<double>(missing_s));
  }
  /// Of the last question.
  Time at() const noexcept { return at_; }

 private:
  Rate rate_;
  double left_;
  Time at_;
};

}  // namespace drivebench
