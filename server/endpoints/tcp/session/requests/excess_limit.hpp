#pragma once

#include <chrono>

#include "server/access/allowance.hpp"
#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// Limits the exchanges of a session that no tick can use, in real time: kAtOnce may come together, and one
/// more with every tick. Beyond that the server pauses in serving the session.
class ExcessLimit {
 public:
  explicit ExcessLimit(Dialogue& dialogue);

  /// Counts an exchange that no tick can use.
  void charge();
  /// The pause in serving the session, so long that it sends at most about two exchanges a tick.
  ServerClock::duration pause();

 private:
  static constexpr double kAtOnce = 1000.0;
  static constexpr auto kLongestPause = std::chrono::seconds(1);

  Dialogue& dialogue_;
  Allowance allowance_;
};

}  // namespace drivebench
