#include "server/engine/supervisor.hpp"

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <string_view>

namespace drivebench {
namespace {

constexpr auto kLookInterval = std::chrono::milliseconds(100);
constexpr auto kStopInterval = std::chrono::milliseconds(20);

/// Writes to standard error without locks or allocation, which the blocked thread may hold, and without
/// waiting for the reader.
void say(std::string_view sentence) noexcept {
  pollfd out{.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
  if (::poll(&out, 1, 0) <= 0) return;
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, sentence.data(), sentence.size());
}

}  // namespace

Supervisor::Supervisor(asio::io_context& io, Watch& watch, bool ticks_by_itself)
    : watch_(watch), ticks_by_itself_(ticks_by_itself) {
  asio::co_spawn(io, give_signs(), asio::detached);
  thread_ = std::thread([this] { run(); });
}

Supervisor::~Supervisor() {
  stop_.store(true);
  thread_.join();
}

asio::awaitable<void> Supervisor::give_signs() {
  // Not a ServerTimer: the supervisor watches threads in real time, also in a simulation.
  asio::basic_waitable_timer<std::chrono::steady_clock> timer(co_await asio::this_coro::executor);
  for (;;) {
    signs_.fetch_add(1, std::memory_order_relaxed);
    timer.expires_after(kLookInterval / 2);
    co_await timer.async_wait(asio::use_awaitable);
  }
}

void Supervisor::run() {
  pthread_setname_np(pthread_self(), "supervisor");
  Stillness ticks;
  Stillness signs;
  bool io_stands = false;
  std::uint64_t seen_signs = 0;
  std::uint64_t seen_resets = 0;
  for (;;) {
    for (auto waited = std::chrono::milliseconds(0); waited < kLookInterval; waited += kStopInterval) {
      if (stop_.load(std::memory_order_relaxed)) return;
      std::this_thread::sleep_for(kStopInterval);
    }
    if (ticks_by_itself_ && ticks.look(watch_.beats())) {
      say("drivebench-server: no tick for a second: the thread of the bench stands still; giving up\n");
      std::abort();
    }
    const std::uint64_t now = signs_.load(std::memory_order_relaxed);
    if (signs.look(now)) {
      io_stands = true;
      seen_signs = now;
      if (ticks_by_itself_) watch_.abandon();
      say(ticks_by_itself_ ? "drivebench-server: the I/O thread stands still: all leases are lost\n"
                           : "drivebench-server: the I/O thread stands still\n");
    } else if (io_stands && now != seen_signs) {
      io_stands = false;
      say("drivebench-server: the I/O thread goes on\n");
    }
    const std::uint64_t resets = watch_.arithmetic_resets();
    if (resets != seen_resets) {
      say("drivebench-server: something changed how this program rounds; set back: the bits of this run are "
          "in doubt\n");
      seen_resets = resets;
    }
  }
}

}  // namespace drivebench
