#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "server/endpoints/log_limit.hpp"
#include "server/host/asio.hpp"

namespace drivebench::can {

/// The address at which a bus listens.
struct HostPort {
  std::string address;
  std::uint16_t port = 0;  ///< 0: chosen by the system
};
/// Splits "127.0.0.1:3333" or "[::1]:3333". Returns the problem; empty: none.
std::string parse_host_port(const std::string& text, HostPort& out);

/// Address and port of the other end of a socket; empty if it has gone.
std::string peer_of(int fd);

/// Accepts TCP clients of a bus from this computer.
class TextListener {
 public:
  explicit TextListener(asio::io_context& io) : acceptor_(io), pause_(io) {}
  TextListener(const TextListener&) = delete;
  TextListener& operator=(const TextListener&) = delete;

  /// Takes over the descriptor of a client.
  std::function<void(int fd)> on_client;

  /// Starts to listen. Returns the problem with its cure; empty: none.
  std::string open(const HostPort& where);
  /// The port on which it listens.
  std::uint16_t port() const;

 private:
  void accept();
  void accept_later();
  void take(asio::ip::tcp::socket socket);

  asio::ip::tcp::acceptor acceptor_;
  ServerTimer pause_;
  LogLimit log_;
  std::shared_ptr<const bool> alive_ =
      std::make_shared<const bool>();  ///< for handlers that outlive the object
};

}  // namespace drivebench::can
