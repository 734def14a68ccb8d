#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "clients/web/gateway/relays/foxglove_session.hpp"
#include "clients/web/gateway/relays/relay.hpp"
#include "protocols/framing.hpp"

namespace drivebench::web {
namespace {

using asio::use_awaitable;
using boost::system::error_code;

constexpr std::size_t kMaxMessage = kMaxRequestFrame;  // of a client

std::string frame_of(const v1::Envelope& envelope) {
  const std::string payload = envelope.SerializeAsString();
  const auto header = frame_header(static_cast<std::uint32_t>(payload.size()));
  return std::string(reinterpret_cast<const char*>(header.data()), header.size()) + payload;
}

/// Three coroutines share it once the bench has said welcome.
class FoxgloveRelay : public Relay, public std::enable_shared_from_this<FoxgloveRelay> {
 public:
  using Relay::Relay;

  asio::awaitable<void> run(Request request, std::string_view subprotocol) {
    co_await accept(std::move(request), kMaxMessage, subprotocol);
    bool goes_on = co_await connect();
    if (goes_on) goes_on = co_await say_hello();
    if (goes_on) {
      const auto self = shared_from_this();
      asio::co_spawn(
          client_.get_executor(), [self] { return self->from_client(); }, asio::detached);
      asio::co_spawn(
          client_.get_executor(), [self] { return self->from_bench(); }, asio::detached);
      co_await to_client();
    }
    co_await close();
  }

 private:
  asio::awaitable<bool> say_hello() {
    v1::Envelope hello;
    hello.set_id(++last_request_);
    hello.mutable_hello()->set_protocol_min(1);
    hello.mutable_hello()->set_protocol_max(1);
    hello.mutable_hello()->set_client("drivebench web, Foxglove");
    hello.mutable_hello()->set_token(context_.bench_token);
    asio::steady_timer deadline(client_.get_executor(), kRequestTime);
    deadline.async_wait([self = shared_from_this()](const error_code& cancelled) {
      error_code ignored;
      if (!cancelled) self->bench_.close(ignored);
    });
    error_code error;
    const std::string frame = frame_of(hello);
    co_await write_to_bench(asio::buffer(frame), error);
    if (!error) co_await read(error);
    const std::optional<v1::Envelope> answer = next_envelope();
    if (answer && answer->has_welcome()) {
      session_.emplace(answer->welcome());
      co_return true;
    }
    end(websocket::close_code::try_again_later,
        answer && answer->has_refusal() ? answer->refusal().message() : "the bench gives no welcome");
    co_return false;
  }

  /// Reads until at least one frame is whole.
  asio::awaitable<void> read(error_code& error) {
    for (;;) {
      frame_ = reader_.next();
      if (frame_ || error || !reader_.error().empty()) co_return;
      const std::span<std::byte> space = reader_.free_space();
      reader_.received(co_await bench_.async_read_some(asio::buffer(space.data(), space.size()),
                                                       asio::redirect_error(use_awaitable, error)));
    }
  }

  std::optional<v1::Envelope> next_envelope() {
    v1::Envelope envelope;
    if (!frame_ || !envelope.ParseFromArray(frame_->data(), static_cast<int>(frame_->size())))
      return std::nullopt;
    return envelope;
  }

  asio::awaitable<void> from_client() {
    error_code error;
    for (beast::flat_buffer buffer; !error; buffer.clear()) {
      co_await client_.async_read(buffer, asio::redirect_error(use_awaitable, error));
      if (error) break;
      const std::string_view message(static_cast<const char*>(buffer.data().data()), buffer.size());
      std::string requests;
      if (client_.got_text()) {
        for (v1::Subscribe& subscribe : session_->text(message)) {
          v1::Envelope envelope;
          envelope.set_id(++last_request_);
          *envelope.mutable_subscribe() = std::move(subscribe);
          requests += frame_of(envelope);
        }
      } else {
        session_->binary(message);
      }
      pause_.cancel();
      if (session_->is_full()) break;
      if (requests.empty()) continue;
      error_code gone;
      co_await write_to_bench(asio::buffer(requests), gone);
      if (gone) co_return;  // from_bench() ends the session
    }
    if (error == websocket::error::message_too_big) ++context_.counts.refusals["size"];
    end(websocket::close_code::normal, session_->is_full() ? "the client reads too slowly" : "");
  }

  /// Reads on however slow the client is: the server would end a session that takes nothing.
  asio::awaitable<void> from_bench() {
    for (error_code error;;) {
      co_await read(error);
      const std::optional<v1::Envelope> envelope = next_envelope();
      if (!envelope || session_->is_full()) break;
      session_->from_bench(*envelope);
      pause_.cancel();
    }
    end(websocket::close_code::going_away,
        session_->is_full() ? "the client reads too slowly" : "the bench has ended the session");
  }

  asio::awaitable<void> to_client() {
    FoxgloveMessage message;
    for (error_code error; !error;) {
      if (!session_->next(message)) {
        const bool goes_on = co_await wait();
        if (!goes_on) co_return;
        continue;
      }
      client_.text(message.is_text);
      co_await client_.async_write(asio::buffer(message.bytes), asio::redirect_error(use_awaitable, error));
      context_.counts.bytes_to_browsers += message.bytes.size();
    }
    end(websocket::close_code::normal, "");
  }

  FrameReader reader_{kMaxReplyFrame};
  std::optional<std::span<const std::byte>> frame_{};  // the last that was read
  std::optional<FoxgloveSession> session_{};
  std::uint64_t last_request_ = 0;
};

}  // namespace

asio::awaitable<void> relay_foxglove(RelayContext& context, Stream stream, Request request,
                                     std::string_view subprotocol) {
  co_await std::make_shared<FoxgloveRelay>(context, std::move(stream))->run(std::move(request), subprotocol);
}

}  // namespace drivebench::web
