#include "server/host/run_io.hpp"

namespace drivebench {

void run_io(asio::io_context& io, std::chrono::microseconds spin) {
  using HostClock = std::chrono::steady_clock;  // short times of the host, in simulated time too
  if (spin.count() == 0) {
    io.run();
    return;
  }
  while (io.run_one() != 0) {
    for (HostClock::time_point end = HostClock::now() + spin; !io.stopped() && HostClock::now() < end;) {
      if (io.poll() != 0) end = HostClock::now() + spin;
    }
  }
}

}  // namespace drivebench
