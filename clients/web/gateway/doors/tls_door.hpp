#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "clients/web/gateway/doors/asio.hpp"

namespace drivebench::web {

/// Accepts browsers that speak TLS 1.3 and gives each a plain stream, so that the rest of the gateway needs
/// no TLS. Bytes are carried between the two until one ends.
class TlsDoor {
 public:
  using PlainSocket = asio::generic::stream_protocol::socket;

  /// Throws StartError that names option and file.
  TlsDoor(const std::filesystem::path& certificate, const std::filesystem::path& key);
  ~TlsDoor();

  /// Shakes hands; meanwhile `close` ends it. Throws when that fails.
  asio::awaitable<PlainSocket> shake_hands(asio::ip::tcp::socket socket, std::function<void()>& close);

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

}  // namespace drivebench::web
