#pragma once

#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <string>
#include <string_view>

#include "clients/web/gateway/doors/asio.hpp"
#include "clients/web/gateway/reports/reports.hpp"
#include "clients/web/gateway/runs/runs.hpp"

namespace drivebench::web {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;

using Request = http::request<http::empty_body>;
using Stream = beast::basic_stream<asio::generic::stream_protocol>;

inline constexpr std::chrono::seconds kRequestTime{10};  ///< for a handshake, a request or an answer

/// What the relays share. One thread runs everything but the calls that wait for the bench.
struct RelayContext {
  std::string bench;        ///< its address
  std::string bench_token;  ///< of the gateway's own sessions
  GatewayCounts& counts;
  asio::thread_pool& connecting;
  Runs* runs = nullptr;  ///< null: browsers start none
};

/// A WebSocket and its session with the bench, until one of them ends. The coroutine that sends to the client
/// also closes.
class Relay {
 public:
  Relay(RelayContext& context, Stream stream);
  ~Relay() { --context_.counts.browsers; }
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

 protected:
  /// Accepts the request, with this subprotocol unless it is empty.
  asio::awaitable<void> accept(Request request, std::size_t max_message, std::string_view subprotocol);
  /// Connects to the bench on another thread, since that may wait.
  asio::awaitable<bool> connect();
  /// A bench that takes no more has gone: after an error its last words are still read, and then the end.
  asio::awaitable<void> write_to_bench(asio::const_buffer bytes, boost::system::error_code& error);
  /// Notes the reason for the client; the first one counts.
  void end(websocket::close_code code, std::string_view why);
  /// Waits until there may be something to send; false: the relay has ended.
  asio::awaitable<bool> wait();
  asio::awaitable<void> close();

  RelayContext& context_;
  websocket::stream<Stream> client_;
  asio::generic::stream_protocol::socket bench_;
  asio::steady_timer pause_;  // of the coroutine that sends to the client
  websocket::close_reason reason_{websocket::close_code::none};
};

/// The page: passes frames of bench.proto on, both ways.
asio::awaitable<void> relay_page(RelayContext& context, Stream stream, Request request);

/// A client of Foxglove with this subprotocol: only subscribes, in a session of the gateway.
asio::awaitable<void> relay_foxglove(RelayContext& context, Stream stream, Request request,
                                     std::string_view subprotocol);

}  // namespace drivebench::web
