#include "server/endpoints/can/buses/text_listener.hpp"

#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "protocols/can/formats/text.hpp"
#include "server/config/config.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench::can {
namespace {

// Small, so that the waiting bytes are not old.
constexpr int kSendBufferBytes = 16 * 1024;
// The pause after an accept that failed for lack of descriptors.
constexpr auto kAcceptPause = std::chrono::milliseconds(100);

}  // namespace

std::string parse_host_port(const std::string& text, HostPort& out) {
  const std::size_t colon = text.rfind(':');
  const auto port = colon == std::string::npos
                        ? std::nullopt
                        : parse_number<std::uint16_t>(std::string_view(text).substr(colon + 1), 10);
  out.address = text.substr(0, std::min(colon, text.size()));
  const bool bracketed = out.address.starts_with('[') && out.address.ends_with(']');
  if (bracketed) out.address = out.address.substr(1, out.address.size() - 2);
  const bool is_v6 = out.address.find(':') != std::string::npos;
  if (!port || !is_address(out.address) || bracketed != is_v6)
    return "\"" + text + "\" is not ADDRESS:PORT, such as 127.0.0.1:3333 or [::1]:3333";
  out.port = *port;
  return {};
}

std::string peer_of(int fd) {
  asio::ip::tcp::endpoint peer;
  socklen_t size = static_cast<socklen_t>(peer.capacity());
  if (::getpeername(fd, peer.data(), &size) != 0) return {};
  peer.resize(size);
  return peer.address().to_string() + ":" + std::to_string(peer.port());
}

std::string TextListener::open(const HostPort& where) {
  if (!is_loopback(where.address)) {
    return where.address +
           " can be reached by other computers, and this protocol knows no password: use 127.0.0.1, and an "
           "SSH "
           "tunnel for clients elsewhere";
  }
  boost::system::error_code error;
  const asio::ip::tcp::endpoint endpoint(
      asio::ip::make_address(where.address == "localhost" ? "127.0.0.1" : where.address), where.port);
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(asio::ip::tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (!error) {
    accept();
    return {};
  }
  boost::system::error_code ignored;
  acceptor_.close(ignored);
  return error.message();
}

std::uint16_t TextListener::port() const {
  boost::system::error_code error;
  return acceptor_.local_endpoint(error).port();
}

void TextListener::accept() {
  acceptor_.async_accept([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error,
                                                               asio::ip::tcp::socket socket) {
    if (alive.expired() || error == asio::error::operation_aborted) return;
    if (error) {
      if (log_.allow()) {
        log::warn("cannot accept a CAN client: {} ({} more since the last such line)", error.message(),
                  log_.held_back());
      }
      return accept_later();
    }
    take(std::move(socket));
    accept();
  });
}

void TextListener::accept_later() {
  pause_.expires_after(kAcceptPause);
  pause_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& aborted) {
    if (!alive.expired() && !aborted) accept();
  });
}

void TextListener::take(asio::ip::tcp::socket socket) {
  boost::system::error_code error;
  socket.set_option(asio::ip::tcp::no_delay(true), error);
  socket.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), error);
  socket.set_option(asio::socket_base::keep_alive(true), error);
  const int fd = socket.release(error);
  if (!error) on_client(fd);
}

}  // namespace drivebench::can
