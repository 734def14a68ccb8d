#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/engine/engine.hpp"
#include "tests/adversity/simulator/account/account.hpp"
#include "tests/adversity/simulator/account/trace.hpp"
#include "tests/adversity/simulator/world/random.hpp"
#include "tests/adversity/simulator/world/schedule.hpp"

namespace drivebench::simulator {

/// What all who play a part share.
struct Scene {
  explicit Scene(std::uint64_t seed, bool prints) : random(seed), trace(prints) {}

  /// The first promise that did not hold, if any.
  struct Failure {
    Time time = 0;
    std::string promise;
  };

  void note(const char* what, std::uint64_t who = 0, std::uint64_t a = 0, std::uint64_t b = 0) {
    trace.add(schedule.now(), what, who, a, b);
  }
  void require(bool holds, const std::string& promise) {
    if (!holds && failure.promise.empty()) failure = {.time = schedule.now(), .promise = promise};
  }

  Random random;
  Schedule schedule;
  Trace trace;
  Engine* engine = nullptr;
  std::string unix_path;
  std::vector<AxisAccount> axes;
  /// Time in which neither the host nor the I/O stood still; a stall counts from its beginning.
  Time awake() const { return schedule.now() - stalled; }
  Time lease() const {
    const BenchSetup& setup = engine->config().setup;
    return setup.lease_ticks * setup.period_ns;
  }
  /// For stalls that end in the middle of something.
  static constexpr Time kSlack = 400 * kMillisecond;

  Time stalled_until = 0;                  ///< the last time that the host stood still, or the I/O did
  Time stalled = 0;                        ///< for so long all in all
  std::function<std::size_t()> connected;  ///< stream clients that the server has not left
  /// A disk has stood still, while which refused commands in lockstep are not counted.
  bool time_waited = false;
  bool ending = false;  ///< everybody finishes what is under way
  Failure failure;
};

/// Somebody outside of the server.
class Player {
 public:
  virtual ~Player() = default;
  /// From now on it acts by itself.
  virtual void start() = 0;
  /// It begins nothing new, and its network is a good one.
  virtual void finish() = 0;
  /// After a second of that: what it was promised must be there.
  virtual void check_end() = 0;
  virtual void leave() = 0;
  /// Whether it is on the stream socket, and the server's end is still there.
  virtual bool has_session() const { return false; }
};

}  // namespace drivebench::simulator
