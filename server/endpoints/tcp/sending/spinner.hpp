#pragma once

#include <chrono>
#include <cstddef>
#include <vector>

#include "server/host/asio.hpp"

namespace drivebench {

/// Looks again and again at memory that clients share with the bench, on the I/O thread. It does so in short
/// turns, and between two of them the I/O thread serves sockets and timers as ever.
class Spinner {
 public:
  using Clock = std::chrono::steady_clock;  // short times of the host, in simulated time too

  /// A place that a client may write at any time.
  class Door {
   public:
    /// Serves one request of the client, if there is one. False: there is no need to look again before the
    /// next watch().
    virtual bool look(Clock::time_point now) = 0;

   protected:
    ~Door() = default;
  };

  explicit Spinner(asio::io_context& io) : io_(io) {}

  /// Looks at the door from now on.
  void watch(Door& door);
  /// Does not look at it any more.
  void leave(Door& door);

 private:
  static constexpr auto kTurn = std::chrono::microseconds(20);

  void take_turn();

  asio::io_context& io_;
  std::vector<Door*> doors_;  // null: has left
  std::size_t next_ = 0;      // of doors_
  bool turn_to_come_ = false;
};

}  // namespace drivebench
