#include "server/stop_signal.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <utility>

namespace drivebench {
namespace {

volatile std::sig_atomic_t event_of_handler = -1;

void leave_to_the_system() noexcept {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

extern "C" void on_signal(int) {
  const int error = errno;
  leave_to_the_system();
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(event_of_handler, &one, sizeof(one));
  errno = error;
}

}  // namespace

StopSignal::StopSignal(asio::io_context& io, std::function<void()> on_stop)
    : event_(io, ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  event_.async_wait(asio::posix::stream_descriptor::wait_read,
                    [on_stop = std::move(on_stop)](const boost::system::error_code& error) {
                      if (!error) on_stop();
                    });
  event_of_handler = event_.native_handle();
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
}

StopSignal::~StopSignal() {
  leave_to_the_system();
}

}  // namespace drivebench
