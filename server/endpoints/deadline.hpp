#pragma once

#include <chrono>
#include <utility>

#include "server/host/asio.hpp"

namespace drivebench {

/// A limit for a peer, in the time that this process runs. After a pause of the process (a signal, a virtual
/// machine, a thread that hung) the bytes of the peer and the end of its time arrive together; then the peer
/// gets the time of the pause on top, since a queued handler can no longer be cancelled and its bytes may
/// still be on their way through the server.
class Deadline {
 public:
  explicit Deadline(const asio::any_io_executor& executor) : timer_(executor) {}

  /// Calls `on_over` after this time and drops the callback of an earlier set(). `on_over` must keep the
  /// owner of this object alive.
  template <class OnOver>
  void set(ServerClock::duration limit, OnOver on_over) {
    timer_.expires_after(limit);
    timer_.async_wait([this, on_over = std::move(on_over)](const boost::system::error_code& error) mutable {
      if (error) return;
      const ServerClock::duration late = ServerClock::now() - timer_.expiry();
      if (late < ServerClock::duration::zero()) return;  // set again or called off meanwhile
      if (late > kPause) return set(late, std::move(on_over));
      on_over();
    });
  }
  void call_off() { timer_.expires_at(ServerClock::time_point::max()); }

 private:
  /// A timer that is this late shows that the process was paused.
  static constexpr auto kPause = std::chrono::milliseconds(100);

  ServerTimer timer_;
};

}  // namespace drivebench
