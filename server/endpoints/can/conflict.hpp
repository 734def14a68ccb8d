#pragma once

#include <algorithm>
#include <chrono>

#include "server/host/clock.hpp"

namespace drivebench::can {

/// The effect of foreign frames with the identifiers of an axis: the first one makes it silent for a
/// second, and each one that comes after a pause doubles the next pause, up to 10 s. A pause always ends; the
/// conflict is over after 10 s in which the axis was free to send and no such frame came.
class Conflict {
 public:
  using Time = ServerClock::time_point;

  /// Takes such a frame. During a pause it changes nothing.
  void note(Time now) noexcept {
    if (silent_) return;
    pause_ = lasts_ ? std::min(2 * pause_, kLongestPause) : kFirstPause;
    silent_ = lasts_ = true;
    since_ = now;
  }
  /// To be called often. Returns whether a pause has just ended.
  bool look(Time now) noexcept {
    if (lasts_ && now - since_ >= pause_ + kCalm) lasts_ = false;
    if (!silent_ || now - since_ < pause_) return false;
    silent_ = false;
    return true;
  }

  bool is_silent() const noexcept { return silent_; }
  /// From the first frame until the conflict is over.
  bool lasts() const noexcept { return lasts_; }
  ServerClock::duration pause() const noexcept { return pause_; }

 private:
  static constexpr ServerClock::duration kFirstPause = std::chrono::seconds(1);
  static constexpr ServerClock::duration kLongestPause = std::chrono::seconds(10);
  static constexpr ServerClock::duration kCalm = std::chrono::seconds(10);

  Time since_{};
  ServerClock::duration pause_{};
  bool silent_ = false;
  bool lasts_ = false;
};

}  // namespace drivebench::can
