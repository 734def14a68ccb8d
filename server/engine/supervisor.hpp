#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>

#include "server/engine/watch.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// A thread that looks every 100 ms whether the others go on. Ten looks in a row without a tick of a bench in
/// real time end the program with a core: what a controller sees then is a bench that is gone, not one that
/// lies. Ten looks without a sign of the I/O thread take the leases away, which makes every axis safe.
///
/// Looks are counted, not time: a process that was stopped as a whole, or a machine that was, has not stood
/// still.
class Supervisor {
 public:
  /// `ticks_by_itself`: ticks must go on without commands, as in real time.
  Supervisor(asio::io_context& io, Watch& watch, bool ticks_by_itself);
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Counts looks without progress.
  class Stillness {
   public:
    static constexpr int kLooks = 10;
    /// Whether this is the tenth look in a row that found the same number.
    bool look(std::uint64_t progress) noexcept {
      looks_ = progress == last_ ? looks_ + 1 : 0;
      last_ = progress;
      return looks_ == kLooks;
    }

   private:
    std::uint64_t last_ = 0;
    int looks_ = 0;
  };

 private:
  void run();
  asio::awaitable<void> give_signs();

  Watch& watch_;
  bool ticks_by_itself_;
  std::atomic<std::uint64_t> signs_{1};  // of the I/O thread
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace drivebench
