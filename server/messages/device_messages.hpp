#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/engine/engine.hpp"
#include "server/messages/device_message.hpp"
#include "server/messages/register_writer.hpp"

namespace drivebench {

/// Sends messages to the device under test, on the I/O thread, each before the sample of its tick goes out.
/// In lockstep a device that has that sample can read its line and its frame, and has confirmed its
/// registers.
class DeviceMessages {
 public:
  /// Puts a frame on a bus of the bench. Returns why it cannot; empty: it has.
  using SendFrame = std::function<std::string(std::size_t bus, const can::Frame& frame)>;

  /// What became of a message.
  struct Outcome {
    Tick tick = 0;  ///< whose sample it preceded
    std::string text{};
    std::string problem{};  ///< why it did not arrive; empty: nothing is known against it
  };

  /// `lines`: the file, mostly a FIFO, that takes the lines; none if it is empty. Throws std::runtime_error
  /// if it cannot be opened, or a message needs it.
  DeviceMessages(std::vector<DeviceMessage> messages, const std::string& lines, SendFrame send_frame);
  DeviceMessages(const DeviceMessages&) = delete;
  DeviceMessages& operator=(const DeviceMessages&) = delete;
  ~DeviceMessages();

  /// Before all who send samples.
  void serve(Engine& engine);
  /// Every message that was sent, in order, when all writes are done.
  std::vector<Outcome> outcomes();

 private:
  struct Pending {
    DeviceMessage message;
    bool is_sent = false;
    Tick held = 0;  ///< ticks for which the condition has held
    std::optional<Tick> due{};
  };

  void begin();
  void look();
  void send(const DeviceMessage& message, Tick tick);
  std::string write_line(const std::string& text) const;

  std::vector<Pending> pending_;
  int lines_ = -1;
  SendFrame send_frame_;
  Engine* engine_ = nullptr;
  std::mutex mutex_;
  std::vector<Outcome> outcomes_;
  std::optional<RegisterWriter> writer_;  // the last member: it ends before the others go
};

}  // namespace drivebench
