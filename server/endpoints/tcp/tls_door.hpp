#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/config/config.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// Accepts clients that speak TLS 1.3 and gives each session a plain stream, so that a session needs no TLS.
/// A handshake may take kHandshakeLimit.
///
/// The session has one end of a pair of unix sockets. This object carries bytes between the other end and the
/// peer, one block at a time in each direction, so that the server notices a peer that does not read as
/// without TLS.
class TlsDoor {
 public:
  static constexpr auto kHandshakeLimit = std::chrono::seconds(2);

  /// Throws std::runtime_error that names the file if one of them cannot be used.
  TlsDoor(asio::io_context& io, const TlsConfig& config);
  ~TlsDoor();

  using PlainSocket = asio::generic::stream_protocol::socket;
  /// Called when a client takes nothing for Outbox::kNoProgressLimit, before it is cut off.
  using OnDeaf = std::function<void()>;
  /// Takes a client after the handshake, with the name in its certificate (empty: no certificate).
  using LetIn = std::function<OnDeaf(PlainSocket, const std::string& subject)>;

  struct Guest {
    std::function<void()> on_first_bytes;
    std::function<void(const std::string& why)> on_refused;  ///< instead of let_in
    LetIn let_in;
  };
  /// Ends a handshake, with the reason for on_refused.
  using End = std::function<void(const std::string& why)>;

  /// Shakes hands with a peer and hands its plain socket to `let_in`.
  End receive(asio::ip::tcp::socket socket, Guest guest);

 private:
  class Passage;

  asio::awaitable<void> shake_hands(std::shared_ptr<Passage> passage, Guest guest);

  struct Context;
  asio::io_context& io_;
  std::unique_ptr<Context> context_;
};

}  // namespace drivebench
