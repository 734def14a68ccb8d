#pragma once

#include <deque>
#include <string>
#include <string_view>

#include "clients/link/can/can_bus.hpp"
#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::link {

/// A bus of texts over a stream: a terminal or a TCP connection.
class TextBus : public CanBus {
 public:
  std::optional<can::Frame> receive(Clock::time_point until) override;

 protected:
  TextBus(std::string name, FileDescriptor fd);

  virtual void take(char byte) = 0;
  void add(const can::Frame& frame) { frames_.push_back(frame); }

  void write(std::string_view text);
  /// False if nothing came in time or a signal did.
  bool read_some(Clock::time_point until);

  const std::string& name() const noexcept { return name_; }

 private:
  bool wait_for(short events, Clock::time_point until);

  std::string name_;
  FileDescriptor fd_;
  std::deque<can::Frame> frames_;
};

}  // namespace drivebench::link
