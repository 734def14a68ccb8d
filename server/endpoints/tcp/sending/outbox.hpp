#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "server/endpoints/deadline.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// The bytes that wait in all outboxes of a server.
struct OutboxPool {
  /// Each outbox may hold as many bytes as the others leave free of these, so that each of many peers that do
  /// not read gets little memory.
  static constexpr std::size_t kMaxBytes = std::size_t{16} * 1024 * 1024;
  std::size_t bytes = 0;
};

/// The sending side of a stream socket: writes what the kernel takes at once, queues the rest up to a limit,
/// and cuts off a peer that takes nothing for a while. Belongs to a session, which it keeps alive while a
/// write is under way.
class Outbox {
 public:
  using Socket = asio::generic::stream_protocol::socket;

  /// The most waiting bytes; above it the outbox cuts the peer off. The lower limit holds however full the
  /// pool is.
  static constexpr std::size_t kMaxQueued = std::size_t{1024} * 1024;
  static constexpr std::size_t kAlwaysQueued = std::size_t{64} * 1024;
  static constexpr auto kNoProgressLimit = std::chrono::seconds(2);

  Outbox(Socket& socket, std::shared_ptr<OutboxPool> pool)
      : socket_(socket), pool_(std::move(pool)), deadline_(socket.get_executor()) {}
  ~Outbox() { forget(waiting_); }
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  /// Sends or queues the bytes; `owner` is kept alive as long as needed.
  void send(std::span<const std::byte> bytes, const std::shared_ptr<void>& owner);

  /// Whether the kernel has taken all bytes so far.
  bool idle() const noexcept { return !writing_; }

  /// Called when the peer is cut off, with the reason.
  std::function<void(std::string_view)> on_cut;
  /// Called when the queue has become empty again.
  std::function<void()> on_idle;

  /// Closes the socket and reports the reason, unless it is closed already.
  void cut(std::string_view why);
  /// Cuts off a peer that took nothing for kNoProgressLimit.
  void cut_deaf();
  /// Ends after an error of the socket. The kernel gives up a connection whose peer acknowledges nothing,
  /// often before kNoProgressLimit has begun: the peer counts as cut off.
  void lose(const boost::system::error_code& error);
  /// Shuts the socket down; queued bytes are lost.
  void close() noexcept;

 private:
  void write_more(const std::shared_ptr<void>& owner);
  void expect_progress(const std::shared_ptr<void>& owner);
  void queue(std::span<const std::byte> bytes);
  std::size_t limit() const noexcept;
  void forget(std::size_t bytes) noexcept;

  Socket& socket_;
  std::shared_ptr<OutboxPool> pool_;  // a session may outlive the server, as long as its socket
  Deadline deadline_;
  std::deque<std::vector<std::byte>> chunks_;
  std::size_t sent_ = 0;     // of the first chunk
  std::size_t waiting_ = 0;  // in all
  bool writing_ = false;
};

}  // namespace drivebench
