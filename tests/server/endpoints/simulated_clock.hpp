#pragma once

#include <memory>

#include "server/host/asio.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// The server's clock, which stands still or jumps, until the end of a test.
class SimulatedClock {
 public:
  SimulatedClock() { ServerClock::simulate(now_); }
  ~SimulatedClock() { ServerClock::simulate(ServerClock::time_point(ServerClock::duration(-1))); }
  SimulatedClock(const SimulatedClock&) = delete;
  SimulatedClock& operator=(const SimulatedClock&) = delete;
  /// Timers that are due then fire at the next turn of the io_context, together with all other events.
  void pass(asio::io_context& io, ServerClock::duration time) {
    ServerClock::simulate(now_ += time);
    const auto waker = std::make_shared<ServerTimer>(io, ServerClock::time_point::min());
    waker->async_wait([waker](const boost::system::error_code&) {});
  }

 private:
  ServerClock::time_point now_ = ServerClock::now();
};

}  // namespace drivebench
