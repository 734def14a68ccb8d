#pragma once

#include <functional>

#include "server/host/asio.hpp"

namespace drivebench {

/// SIGINT and SIGTERM: the first one asks for the end of the run; another one, at least half a second later,
/// ends the program at once. Signals in between are ignored: a shell signals a whole group, and `timeout`
/// signals the program and its group. A program has at most one object of this class.
class StopSignal {
 public:
  /// `on_stop` is called on the I/O thread.
  StopSignal(asio::io_context& io, std::function<void()> on_stop);
  /// Whether the first one has come: for work that keeps the I/O thread.
  bool has_come() const noexcept;
  /// Afterwards the next signal ends the program.
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

 private:
  asio::posix::stream_descriptor event_;
};

}  // namespace drivebench
