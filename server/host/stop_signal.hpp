#pragma once

#include <functional>

#include "server/host/asio.hpp"

namespace drivebench {

/// SIGINT and SIGTERM: the first one asks for the end of the run, another half a second later ends the
/// program at once, whatever it is doing. What comes before that is the same order once more: a shell signals
/// a whole group, `timeout` a program and its group. One object in a program at most.
class StopSignal {
 public:
  /// `on_stop` is called on the I/O thread.
  StopSignal(asio::io_context& io, std::function<void()> on_stop);
  /// From here on a first one ends the program.
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

 private:
  asio::posix::stream_descriptor event_;
};

}  // namespace drivebench
