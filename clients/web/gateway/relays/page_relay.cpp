#include <algorithm>
#include <deque>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clients/web/gateway/drive/drive.hpp"
#include "clients/web/gateway/relays/frames.hpp"
#include "clients/web/gateway/relays/relay.hpp"
#include "clients/web/gateway/relays/send_queue.hpp"
#include "protocols/framing.hpp"
#include "protocols/json.hpp"

namespace drivebench::web {
namespace {

using asio::use_awaitable;
using boost::system::error_code;
using namespace std::chrono_literals;

constexpr auto kBetweenMessages = 4ms;    // to a browser: many small frames become one message
constexpr std::size_t kMostAnswers = 16;  // to orders for the runs; they wait for the browser

Drive::Time now() {
  return std::chrono::steady_clock::now();
}

/// Four coroutines share it. Binary messages of the page are frames for the bench; texts are orders for its
/// drive, whose requests go out between those frames, and for the runs of the gateway.
class PageRelay : public Relay, public std::enable_shared_from_this<PageRelay> {
 public:
  PageRelay(RelayContext& context, Stream stream)
      : Relay(context, std::move(stream)),
        turn_(client_.get_executor()),
        turnstile_(client_.get_executor()) {}

  asio::awaitable<void> run(Request request) {
    client_.binary(true);
    co_await accept(std::move(request), kFrameHeaderSize + kMaxRequestFrame, {});
    const bool is_connected = co_await connect();
    if (is_connected) {
      const auto self = shared_from_this();
      const auto executor = client_.get_executor();
      asio::co_spawn(
          executor, [self] { return self->from_browser(); }, asio::detached);
      asio::co_spawn(
          executor, [self] { return self->from_bench(); }, asio::detached);
      asio::co_spawn(
          executor, [self] { return self->drive(); }, asio::detached);
      co_await to_browser();
    }
    co_await close();
  }

 private:
  asio::awaitable<void> from_browser() {
    error_code error;
    for (beast::flat_buffer buffer; !error; buffer.clear()) {
      co_await client_.async_read(buffer, asio::redirect_error(use_awaitable, error));
      if (error) break;
      const std::span message(static_cast<const std::byte*>(buffer.data().data()), buffer.size());
      const bool is_order = !client_.got_binary();
      const std::string_view problem = is_order ? co_await carry_out(message) : problem_of_frames(message);
      if (!problem.empty()) {
        ++context_.counts.refusals["frame"];
        leave(websocket::close_code::protocol_error, problem);
        co_return;
      }
      if (told_of_runs_.size() > kMostAnswers) {
        leave(websocket::close_code::going_away, "the browser reads too slowly");
        co_return;
      }
      error_code gone;
      if (!is_order) co_await write(buffer.data(), gone);
      if (gone) co_return;
    }
    if (error == websocket::error::message_too_big) ++context_.counts.refusals["size"];
    leave(websocket::close_code::normal, "");
  }

  /// Gives a text to the drive, which answers a wrong one, or to the runs; the reason why it cannot, or
  /// nothing. Runs are made on another thread: this one has the commands of all pages to send.
  asio::awaitable<std::string_view> carry_out(std::span<const std::byte> message) {
    if (!drive_) co_return "before the welcome of the bench messages are binary";
    try {
      const Order order = drive_->read({reinterpret_cast<const char*>(message.data()), message.size()});
      if (order.is_for_runs()) {
        const auto ask = [&]() -> asio::awaitable<std::string> { co_return answer_of_runs(order); };
        told_of_runs_.push_back(co_await asio::co_spawn(context_.connecting, ask, use_awaitable));
        pause_.cancel();
        co_return std::string_view();
      }
      Drive::Runs begun;
      if (const std::vector<Beginning> beginnings = drive_->beginnings_of(order); !beginnings.empty()) {
        const auto make = [&]() -> asio::awaitable<Drive::Runs> {
          co_return made_runs(drive_->bench(), beginnings);
        };
        begun = co_await asio::co_spawn(context_.connecting, make, use_awaitable);
      }
      drive_->carry_out(order, std::move(begun), now());
    } catch (const OrderError& error) {
      ++context_.counts.refusals["order"];
      drive_->tell(error.what());
    }
    turn_.cancel();
    co_return std::string_view();
  }

  /// What the page is told of an order for the runs, as JSON: {"runs": {"said", "is_refusal", "run"}}.
  std::string answer_of_runs(const Order& order) {
    const auto answer = [](const RunAnswer& said, bool is_refusal) {
      return json_text(nlohmann::ordered_json{
          {"runs", {{"said", said.sentence}, {"is_refusal", is_refusal}, {"run", said.number}}}});
    };
    try {
      return answer(carried_out_by_runs(order), false);
    } catch (const RunRefusal& refusal) {
      return answer({.sentence = refusal.what()}, true);
    }
  }

  /// The bench knows who may change something there, and no one else may start programs here.
  RunAnswer carried_out_by_runs(const Order& order) {
    if (context_.runs == nullptr)
      throw RunRefusal("this gateway runs nothing: it was started without --suites and --identify");
    if (!may_run_) throw RunRefusal("role: the bench lets this browser only look, and so it starts nothing");
    if (order.kind == Order::Kind::kCancelRun) return context_.runs->cancel(order.run);
    if (order.kind == Order::Kind::kRunSuite) return context_.runs->ask(order.suite);
    const Order::Identification& wanted = order.identification;
    return context_.runs->ask({.experiment = wanted.experiment,
                               .owner = wanted.owner,
                               .axis = drive_->bench()->axes(static_cast<int>(wanted.axis)).name(),
                               .motor = wanted.motor});
  }

  /// Writes whole, one coroutine after the other. After an error from_bench() ends the session.
  asio::awaitable<void> write(asio::const_buffer bytes, error_code& error) {
    while (is_writing_) {
      error_code cancelled;
      turnstile_.expires_at(asio::steady_timer::time_point::max());
      co_await turnstile_.async_wait(asio::redirect_error(use_awaitable, cancelled));
    }
    is_writing_ = true;
    co_await write_to_bench(bytes, error);
    is_writing_ = false;
    turnstile_.cancel();
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
        is_taken = pass_on(*frame) && is_taken;
      pause_.cancel();
      if (error) break;
      if (!is_driving()) co_await rest();  // a drive answers at once
    }
    end(websocket::close_code::going_away,
        is_taken ? "the bench has ended the session" : "the browser reads too slowly");
    turn_.cancel();
  }

  bool pass_on(std::span<const std::byte> frame) {
    if (!drive_) begin_drive(frame);
    if (drive_ && drive_->take(frame, now())) {
      turn_.cancel();
      return true;
    }
    return leaving_ || queue_.add(frame);
  }

  /// The welcome has what the drive must know.
  void begin_drive(std::span<const std::byte> frame) {
    v1::Envelope envelope;
    if (!envelope.ParseFromArray(frame.data(), static_cast<int>(frame.size())) || !envelope.has_welcome())
      return;
    const v1::Role role = envelope.welcome().role();
    may_run_ = role == v1::ROLE_OPERATOR || role == v1::ROLE_CONDUCTOR || role == v1::ROLE_ADMIN;
    drive_.emplace(envelope.welcome());
  }

  /// Sends the requests of the drive, until the bench has gone or, without a browser, the drive is over.
  asio::awaitable<void> drive() {
    for (error_code error; !error && bench_.is_open();) {
      const Drive::Turn turn = drive_ ? drive_->next(now()) : Drive::Turn{};
      if (!turn.bytes.empty()) {
        co_await write(asio::buffer(turn.bytes), error);
        continue;
      }
      pause_.cancel();  // for its report
      if (leaving_ && !is_driving()) end(leaving_->code, leaving_->why);
      if (!bench_.is_open()) break;
      error_code cancelled;
      turn_.expires_at(turn.again);
      co_await turn_.async_wait(asio::redirect_error(use_awaitable, cancelled));
    }
  }

  asio::awaitable<void> to_browser() {
    std::vector<std::byte> message;
    for (error_code error; !error && !leaving_;) {
      queue_.take(message);
      const std::string report = drive_ ? drive_->report(now()) : std::string();
      const std::string of_runs = next_answer_of_runs();
      if (!message.empty()) {
        co_await client_.async_write(asio::buffer(message), asio::redirect_error(use_awaitable, error));
      }
      if (!error) co_await write_text(report, error);
      if (!error) co_await write_text(of_runs, error);
      if (!message.empty() || !report.empty() || !of_runs.empty()) {
        context_.counts.bytes_to_browsers += message.size();
        if (is_driving()) co_await rest();
        continue;
      }
      const bool goes_on = co_await wait();
      if (!goes_on) co_return;
    }
    leave(websocket::close_code::normal, "");
    for (bool goes_on = true; goes_on;)
      goes_on = co_await wait();
  }

  /// Empty: none waits.
  std::string next_answer_of_runs() {
    if (told_of_runs_.empty()) return {};
    std::string answer = std::move(told_of_runs_.front());
    told_of_runs_.pop_front();
    return answer;
  }

  asio::awaitable<void> write_text(const std::string& text, error_code& error) {
    if (text.empty()) co_return;
    client_.text(true);
    co_await client_.async_write(asio::buffer(text), asio::redirect_error(use_awaitable, error));
    client_.binary(true);
    context_.counts.bytes_to_browsers += text.size();
  }

  asio::awaitable<void> rest() {
    asio::steady_timer between(client_.get_executor(), kBetweenMessages);
    co_await between.async_wait(use_awaitable);
  }

  bool is_driving() const noexcept { return drive_ && !drive_->is_over(); }

  /// The browser has gone, or must: its drive ends first.
  void leave(websocket::close_code code, std::string_view why) {
    if (!is_driving()) return end(code, why);
    if (leaving_) return;
    leaving_ = Leaving{.code = code, .why = std::string(why)};
    drive_->leave(now());
    turn_.cancel();
  }

  /// The browser has gone, its drive has not.
  struct Leaving {
    websocket::close_code code;
    std::string why;
  };

  SendQueue queue_{};
  std::optional<Drive> drive_{};  // after the welcome
  asio::steady_timer turn_;       // of the drive
  asio::steady_timer turnstile_;  // of what is written to the bench
  bool is_writing_ = false;
  bool may_run_ = false;                    // by its role with the bench
  std::deque<std::string> told_of_runs_{};  // answers that wait for the browser
  std::optional<Leaving> leaving_{};
};

}  // namespace

asio::awaitable<void> relay_page(RelayContext& context, Stream stream, Request request) {
  co_await std::make_shared<PageRelay>(context, std::move(stream))->run(std::move(request));
}

}  // namespace drivebench::web
