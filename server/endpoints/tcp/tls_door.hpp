#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/config/config.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// Accepts clients that speak TLS 1.3 and gives each session a plain stream, so that a session needs no TLS.
/// At most kMaxHandshakes handshakes run at a time, each for at most kHandshakeLimit.
///
/// The session has one end of a pair of unix sockets. This object carries bytes between the other end and the
/// peer, one block at a time in each direction, so that the server notices a peer that does not read as
/// without TLS.
class TlsDoor {
 public:
  static constexpr int kMaxHandshakes = 32;
  static constexpr auto kHandshakeLimit = std::chrono::seconds(2);

  /// Throws std::runtime_error that names the file if one of them cannot be used.
  TlsDoor(asio::io_context& io, const TlsConfig& config);
  ~TlsDoor();

  using PlainSocket = asio::generic::stream_protocol::socket;
  /// Called when a client takes nothing for Outbox::kNoProgressLimit, before it is cut off.
  using OnDeaf = std::function<void()>;
  /// Takes a client after the handshake, with the name in its certificate (empty: no certificate).
  using LetIn = std::function<OnDeaf(PlainSocket, const std::string& subject)>;

  /// Called for every refused peer, with the reason. The log has a limited number of them.
  std::function<void(const std::string& peer, const std::string& why)> on_turned_away;

  /// Shakes hands with a peer and hands its plain socket to `let_in`.
  void receive(asio::ip::tcp::socket socket, const std::string& peer, LetIn let_in);

 private:
  class Passage;

  asio::awaitable<void> shake_hands(std::shared_ptr<Passage> passage, std::string peer, LetIn let_in);
  void turn_away(const std::string& peer, const std::string& why);

  struct Context;
  asio::io_context& io_;
  std::unique_ptr<Context> context_;
  int handshakes_ = 0;
  LogLimit log_;
};

}  // namespace drivebench
