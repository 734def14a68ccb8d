#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "clients/web/gateway/relays/frames.hpp"
#include "clients/web/gateway/relays/relay.hpp"
#include "clients/web/gateway/relays/send_queue.hpp"
#include "protocols/framing.hpp"

namespace drivebench::web {
namespace {

using asio::use_awaitable;
using boost::system::error_code;
using namespace std::chrono_literals;

constexpr auto kBetweenMessages = 4ms;  // to a browser: many small frames become one message

/// Three coroutines share it.
class PageRelay : public Relay, public std::enable_shared_from_this<PageRelay> {
 public:
  using Relay::Relay;

  asio::awaitable<void> run(Request request) {
    client_.binary(true);
    co_await accept(std::move(request), kFrameHeaderSize + kMaxRequestFrame, {});
    const bool is_connected = co_await connect();
    if (is_connected) {
      const auto self = shared_from_this();
      asio::co_spawn(
          client_.get_executor(), [self] { return self->to_bench(); }, asio::detached);
      asio::co_spawn(
          client_.get_executor(), [self] { return self->from_bench(); }, asio::detached);
      co_await to_browser();
    }
    co_await close();
  }

 private:
  asio::awaitable<void> to_bench() {
    error_code error;
    for (beast::flat_buffer buffer; !error; buffer.clear()) {
      co_await client_.async_read(buffer, asio::redirect_error(use_awaitable, error));
      if (error) break;
      const std::span message(static_cast<const std::byte*>(buffer.data().data()), buffer.size());
      const std::string_view problem =
          client_.got_binary() ? problem_of_frames(message) : "messages are binary";
      if (!problem.empty()) {
        ++context_.counts.refusals["frame"];
        end(websocket::close_code::protocol_error, problem);
        co_return;
      }
      context_.counts.bytes_to_bench += message.size();
      co_await asio::async_write(bench_, buffer.data(), asio::redirect_error(use_awaitable, error));
    }
    if (error == websocket::error::message_too_big) ++context_.counts.refusals["size"];
    end(websocket::close_code::normal, "");
  }

  /// Reads on however slow the browser is: the server would end a session that takes nothing.
  asio::awaitable<void> from_bench() {
    FrameReader reader(kMaxReplyFrame);
    bool is_taken = true;
    for (error_code error; !error && is_taken && reader.error().empty();) {
      const std::span<std::byte> space = reader.free_space();
      reader.received(co_await bench_.async_read_some(asio::buffer(space.data(), space.size()),
                                                      asio::redirect_error(use_awaitable, error)));
      while (const auto frame = reader.next())
        is_taken = queue_.add(*frame) && is_taken;
      pause_.cancel();
      if (error) break;
      asio::steady_timer between(client_.get_executor(), kBetweenMessages);
      co_await between.async_wait(use_awaitable);
    }
    end(websocket::close_code::going_away,
        is_taken ? "the bench has ended the session" : "the browser reads too slowly");
  }

  asio::awaitable<void> to_browser() {
    std::vector<std::byte> message;
    for (error_code error; !error;) {
      queue_.take(message);
      if (message.empty()) {
        const bool goes_on = co_await wait();
        if (!goes_on) co_return;
        continue;
      }
      co_await client_.async_write(asio::buffer(message), asio::redirect_error(use_awaitable, error));
      context_.counts.bytes_to_browsers += message.size();
    }
    end(websocket::close_code::normal, "");
  }

  SendQueue queue_{};
};

}  // namespace

asio::awaitable<void> relay_page(RelayContext& context, Stream stream, Request request) {
  co_await std::make_shared<PageRelay>(context, std::move(stream))->run(std::move(request));
}

}  // namespace drivebench::web
