#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "server/asio.hpp"

namespace drivebench {

/// The sending side of a stream socket: writes at once what the kernel takes, queues the rest up to a limit,
/// and gives up on a peer that takes nothing for a while. Belongs to a session, which it keeps alive while a
/// write is under way.
class Outbox {
 public:
  using Socket = asio::generic::stream_protocol::socket;

  /// Bytes in all that may wait; above them the peer is cut off.
  static constexpr std::size_t kMaxQueued = std::size_t{1024} * 1024;
  static constexpr auto kNoProgressLimit = std::chrono::seconds(2);

  explicit Outbox(Socket& socket) : socket_(socket), timer_(socket.get_executor()) {}

  /// Sends or queues the bytes; `owner` is kept alive as long as needed.
  void send(std::span<const std::byte> bytes, const std::shared_ptr<void>& owner);

  /// Whether everything so far has gone to the kernel.
  bool idle() const noexcept { return !writing_; }

  /// Called when the peer is cut off, with the reason.
  std::function<void(std::string_view)> on_cut;
  /// Called when the queue has become empty again.
  std::function<void()> on_idle;

  /// Shuts the socket down; what is queued is lost.
  void close() noexcept;

 private:
  void write_more(const std::shared_ptr<void>& owner);
  void arm_timer(const std::shared_ptr<void>& owner);
  void cut(std::string_view why);

  Socket& socket_;
  ServerTimer timer_;
  std::vector<std::byte> queued_;  // behind in_flight_
  std::vector<std::byte> in_flight_;
  std::size_t sent_ = 0;  // of in_flight_
  bool writing_ = false;
};

}  // namespace drivebench
