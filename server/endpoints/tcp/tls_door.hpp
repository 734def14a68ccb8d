#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/config/config.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// The way in for clients that speak TLS: shakes hands, and puts a plain stream behind it, so that a session
/// knows nothing of it. TLS 1.3 and nothing older. At most kMaxHandshakes peers may be shaking hands, each
/// for kHandshakeLimit.
///
/// Behind the door each peer is one end of a pair of unix sockets; this object carries bytes between it and
/// the other end, one block at a time in each direction, so that a peer that does not read is noticed as
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
  /// Takes a client after the handshake, with the name in its certificate (empty: it showed none).
  using LetIn = std::function<OnDeaf(PlainSocket, const std::string& subject)>;

  /// Called for every peer that was turned away, with the reason. The log has a limited number of them.
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
