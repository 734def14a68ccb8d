#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "server/endpoints/can/buses/bus.hpp"
#include "server/endpoints/can/buses/send_queue.hpp"
#include "server/host/asio.hpp"

namespace drivebench::can {

/// A peer that takes frames as text: over a TCP socket, a terminal or a serial line. Its queue is bounded: a
/// peer that reads late gets only the newest frame of each identifier.
class TextPeer {
 public:
  using Encode = std::function<void(std::string& out, const Frame& frame)>;

  /// Owns the descriptor. Counts what it sends and drops in `status`, which outlives it.
  TextPeer(asio::io_context& io, int fd, BusStatus& status, Encode encode);
  TextPeer(const TextPeer&) = delete;
  TextPeer& operator=(const TextPeer&) = delete;

  /// Called with the bytes from the peer. It may end the peer, but not destroy it.
  std::function<void(std::string_view bytes)> on_bytes;
  /// Called once, from the io_context and never from inside another call, when the peer has gone or was
  /// ended. It may destroy the peer.
  std::function<void()> on_end;
  /// Called before on_end if the peer ends because it did not read.
  std::function<void()> on_stall;

  /// Starts to read.
  void start() { wait_readable(); }
  /// Ends a peer that reads nothing for this long although bytes wait for it.
  void set_stall_limit(std::chrono::milliseconds limit) { stall_limit_ = limit; }

  /// Sends text in order and whole; false if the peer has left so much unread that the text has no room.
  bool answer(std::string_view text);
  /// Sends a frame now, or its newest successor as soon as there is room.
  void send(const Frame& frame);
  /// Drops the waiting frames.
  void forget_frames() { status_.send_dropped += frames_.clear(); }
  void end();

 private:
  static constexpr std::size_t kMaxUnsent = 16'384;

  void wait_readable();
  void wait_writable();
  void read();
  void write();
  void watch_for_stall();
  void reset();

  asio::posix::stream_descriptor stream_;
  ServerTimer timer_;
  BusStatus& status_;
  Encode encode_;
  std::string unsent_;  ///< text for which the kernel had no room; frames wait behind it
  SendQueue frames_;
  std::chrono::milliseconds stall_limit_{0};
  std::uint64_t written_ = 0;  ///< bytes
  bool waiting_ = false;       ///< until the descriptor is writable
  bool watching_ = false;
  bool ended_ = false;
  bool is_socket_ = false;
  std::shared_ptr<const bool> alive_ =
      std::make_shared<const bool>();  ///< for handlers that outlive the object
};

}  // namespace drivebench::can
