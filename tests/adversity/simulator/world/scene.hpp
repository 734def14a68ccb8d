#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/engine/engine.hpp"
#include "tests/adversity/simulator/account/account.hpp"
#include "tests/adversity/simulator/account/io_pauses.hpp"
#include "tests/adversity/simulator/account/trace.hpp"
#include "tests/adversity/simulator/world/random.hpp"
#include "tests/adversity/simulator/world/schedule.hpp"

namespace drivebench::simulator {

/// Shared by the server's surroundings: clients, network, disk, host.
struct Scene {
  explicit Scene(std::uint64_t seed, bool prints) : random(seed), trace(prints) {}

  /// The first promise that did not hold, if any.
  struct Failure {
    Time time = 0;
    std::string promise;
  };

  void note(const char* what, std::uint64_t source = 0, std::uint64_t a = 0, std::uint64_t b = 0) {
    trace.add(schedule.now(), what, source, a, b);
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
  /// For stalls that end in the middle of a request.
  static constexpr Time kSlack = 400 * kMillisecond;

  Time stalled_until = 0;                  ///< the last time that the host stood still, or the I/O did
  Time stalled = 0;                        ///< sum of all stalls
  IoPauses io;                             ///< until now
  std::function<std::size_t()> connected;  ///< stream clients that the server has not left
  /// A disk has stood still; meanwhile refused commands in lockstep are not counted.
  bool time_waited = false;
  std::uint64_t forbidden = 0;  ///< requests of known users that were answered so
  bool ending = false;          ///< every player finishes its requests
  Failure failure;
};

/// A client or control board outside of the server.
class Player {
 public:
  virtual ~Player() = default;
  /// From now on it acts by itself.
  virtual void start() = 0;
  /// It begins no more requests, and its network is good.
  virtual void finish() = 0;
  /// A second later: it must have received everything that it was promised.
  virtual void check_end() = 0;
  virtual void leave() = 0;
  /// Whether it is on the stream socket, and the server has not closed its end.
  virtual bool has_session() const { return false; }
};

}  // namespace drivebench::simulator
