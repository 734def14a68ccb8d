#pragma once

#include <functional>

#include "server/asio.hpp"

namespace drivebench {

/// SIGINT and SIGTERM: the first one asks for the end of the run, a second one ends the program at once,
/// whatever it is doing. At most one object in a program.
class StopSignal {
 public:
  /// `on_stop` is called on the I/O thread.
  StopSignal(asio::io_context& io, std::function<void()> on_stop);
  /// From here on the first one ends the program.
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

 private:
  asio::posix::stream_descriptor event_;
};

}  // namespace drivebench
