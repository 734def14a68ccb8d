#include "clients/web/gateway/relays/relay.hpp"

#include <fcntl.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::web {
namespace {

using asio::use_awaitable;
using boost::system::error_code;
using namespace std::chrono_literals;

constexpr auto kSilence = 30s;  // of a client that answers no ping

}  // namespace

Relay::Relay(RelayContext& context, Stream stream)
    : context_(context),
      client_(std::move(stream)),
      bench_(client_.get_executor()),
      pause_(client_.get_executor()) {
  ++context_.counts.browsers;
}

asio::awaitable<void> Relay::accept(Request request, std::size_t max_message, std::string_view subprotocol) {
  client_.set_option(websocket::stream_base::timeout{kRequestTime, kSilence, true});
  client_.set_option(websocket::stream_base::decorator([subprotocol](websocket::response_type& response) {
    if (!subprotocol.empty())
      response.set(http::field::sec_websocket_protocol,
                   beast::string_view(subprotocol.data(), subprotocol.size()));
  }));
  client_.read_message_max(max_message);
  client_.auto_fragment(false);
  co_await client_.async_accept(request, use_awaitable);
}

asio::awaitable<bool> Relay::connect() {
  const auto open = [address = context_.bench]() -> asio::awaitable<int> {
    const link::FileDescriptor socket = link::connect_to(link::parse_address(address), 3000ms);
    co_return ::fcntl(socket.get(), F_DUPFD_CLOEXEC, 0);
  };
  try {
    const int socket = co_await asio::co_spawn(context_.connecting, open, use_awaitable);
    bench_.assign(asio::generic::stream_protocol(AF_UNSPEC, 0), socket);
    co_return true;
  } catch (const std::exception& error) {
    end(websocket::close_code::try_again_later, error.what());
  }
  co_return false;
}

asio::awaitable<void> Relay::write_to_bench(asio::const_buffer bytes, error_code& error) {
  context_.counts.bytes_to_bench += bytes.size();
  co_await asio::async_write(bench_, bytes, asio::redirect_error(use_awaitable, error));
  error_code ignored;
  if (error) bench_.shutdown(asio::socket_base::shutdown_both, ignored);
}

void Relay::end(websocket::close_code code, std::string_view why) {
  if (reason_.code == websocket::close_code::none) {
    reason_ =
        websocket::close_reason(code, beast::string_view(why.data(), std::min<std::size_t>(why.size(), 120)));
  }
  error_code ignored;
  bench_.close(ignored);
  pause_.cancel();
}

asio::awaitable<bool> Relay::wait() {
  if (reason_.code != websocket::close_code::none) co_return false;
  error_code cancelled;
  pause_.expires_at(asio::steady_timer::time_point::max());
  co_await pause_.async_wait(asio::redirect_error(use_awaitable, cancelled));
  co_return true;
}

asio::awaitable<void> Relay::close() {
  error_code ignored;
  co_await client_.async_close(reason_, asio::redirect_error(use_awaitable, ignored));
  bench_.close(ignored);
}

}  // namespace drivebench::web
