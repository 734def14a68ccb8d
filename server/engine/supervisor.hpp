#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>

#include "server/engine/watch.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// A thread that checks every 100 ms whether the other threads go on. After ten checks in a row without a
/// tick in real time it aborts the program with a core: a controller then loses its connection instead of
/// getting old samples. After ten checks without the I/O thread it ends all leases, so that every axis takes
/// its safe action.
///
/// It counts checks, not time, so that stopping the whole process or the machine is no standstill.
class Supervisor {
 public:
  /// `ticks_by_itself`: ticks must go on without commands, as in real time.
  Supervisor(asio::io_context& io, Watch& watch, bool ticks_by_itself);
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Counts checks without progress.
  class Stillness {
   public:
    static constexpr int kLooks = 10;
    /// Whether this is the tenth check in a row with the same number.
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
  std::atomic<std::uint64_t> signs_{1};  // counts the signs of life of the I/O thread
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace drivebench
