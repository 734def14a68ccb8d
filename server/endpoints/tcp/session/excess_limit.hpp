#pragma once

#include <chrono>

#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// Counts the exchanges of a session that no tick can use, in real time: kAtOnce may come together, and one
/// more with every tick. Beyond that the session is not read for a while.
class ExcessLimit {
 public:
  explicit ExcessLimit(Dialogue& dialogue) : dialogue_(dialogue) {}

  /// The session has sent an exchange that no tick can use.
  void charge();
  /// How long the session is not to be read, so that it sends at most about twice as many exchanges as there
  /// are ticks.
  ServerClock::duration pause();

 private:
  static constexpr double kAtOnce = 1000.0;
  static constexpr auto kLongestPause = std::chrono::seconds(1);

  void refill();

  Dialogue& dialogue_;
  double left_ = kAtOnce;
  ServerClock::time_point refilled_ = ServerClock::now();
};

}  // namespace drivebench
