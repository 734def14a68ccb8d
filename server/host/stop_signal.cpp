#include "server/host/stop_signal.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <ctime>
#include <utility>

namespace drivebench {
namespace {

constexpr std::int64_t kNever = 0;
constexpr std::int64_t kLongAgo = 1;

volatile std::sig_atomic_t event_of_handler = -1;
std::atomic<std::int64_t> first_ns{kNever};  // time of the first signal
static_assert(std::atomic<std::int64_t>::is_always_lock_free, "a signal handler changes it");

std::int64_t now_ns() noexcept {
  std::timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

extern "C" void on_signal(int number) {
  constexpr std::int64_t kOneOrder_ns = 500'000'000;
  const int error = errno;
  const std::int64_t now = now_ns();
  std::int64_t first = kNever;
  if (first_ns.compare_exchange_strong(first, now)) {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(event_of_handler, &one, sizeof(one));
  } else if (now - first > kOneOrder_ns) {
    std::signal(number, SIG_DFL);
    ::raise(number);
  }
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

bool StopSignal::has_come() const noexcept {
  return first_ns.load() != kNever;
}

StopSignal::~StopSignal() {
  event_.release();  // stays open: a handler in another thread may still write to it
  std::int64_t none = kNever;
  first_ns.compare_exchange_strong(none, kLongAgo);
}

}  // namespace drivebench
