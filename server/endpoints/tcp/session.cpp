#include "server/endpoints/tcp/session.hpp"

#include <google/protobuf/io/coded_stream.h>

#include <algorithm>

#include "protocols/descriptor_set.hpp"
#include "server/endpoints/tcp/description.hpp"
#include "server/host/build_id.hpp"

namespace drivebench {
namespace {

constexpr std::uint32_t kProtocolVersion = 1;

/// False: not an Envelope, or one that is nested more deeply than any of ours.
bool parse(std::span<const std::byte> frame, v1::Envelope& envelope) {
  constexpr int kMaxNesting = 16;
  google::protobuf::io::CodedInputStream in(reinterpret_cast<const std::uint8_t*>(frame.data()),
                                            static_cast<int>(frame.size()));
  in.SetRecursionLimit(kMaxNesting);
  return envelope.ParseFromCodedStream(&in) && in.ConsumedEntireMessage();
}

}  // namespace

Session::Session(Outbox::Socket socket, Client who, SessionContext& context)
    : socket_(std::move(socket)),
      outbox_(socket_, context.outboxes),
      client_(std::move(who)),
      context_(context),
      engine_(context.engine),
      reader_(kMaxRequestFrame),
      reply_(context.reply),
      scratch_(context.scratch),
      slot_timer_(socket_.get_executor()),
      silence_(socket_.get_executor()),
      leased_(context.engine.config().axes.size()),
      taken_(context.engine.config().axes.size()) {
  reader_.set_max_payload(kMaxFrameBeforeHello);
  socket_.non_blocking(true);
  outbox_.on_idle = [this] {
    send_samples();
    send_experiment();
  };
  outbox_.on_cut = [this](std::string_view why) {
    ++context_.counts.cut;
    why_ended_ = why;
    audit("limit", why, {});
  };
}

asio::awaitable<void> Session::run() {
  const std::shared_ptr<Session> self = shared_from_this();
  ServerTimer timer(socket_.get_executor());
  silence_.set(kHelloLimit, [self] { self->outbox_.cut("no hello within 2 s"); });
  boost::system::error_code error;
  Turn turn = Turn::kAll;
  while (turn != Turn::kOver && !error) {
    const std::span<std::byte> space = reader_.free_space();
    const std::size_t count = co_await socket_.async_read_some(
        asio::buffer(space.data(), space.size()), asio::redirect_error(asio::use_awaitable, error));
    reader_.received(count);
    while ((turn = handle_some()) == Turn::kMoreToCome)
      co_await asio::post(socket_.get_executor(), asio::use_awaitable);
    watch_for_silence();
    const ServerClock::duration pause = throttle();
    if (turn == Turn::kOver || pause == ServerClock::duration::zero()) continue;
    timer.expires_after(pause);
    boost::system::error_code cancelled;
    co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, cancelled));
  }
  timer.cancel();
  if (greeted_) audit("session_ended", "done", {{"reason", why_ended_}});
  give_leases_back();
  close();
}

/// What is there, as far as one turn goes: who asks for much at once shall not keep the others waiting.
Session::Turn Session::handle_some() {
  replied_bytes_ = 0;
  for (int n = 0; n < kRequestsPerTurn && replied_bytes_ < kReplyBytesPerTurn; ++n) {
    if (!socket_.is_open()) return Turn::kOver;
    const auto frame = reader_.next();
    if (frame && handle(*frame)) continue;
    if (frame) return Turn::kOver;
    if (reader_.error().empty()) return Turn::kAll;
    request_.Clear();
    end_malformed(v1::REFUSAL_MALFORMED, std::string(reader_.error()), "frame");
    return Turn::kOver;
  }
  return Turn::kMoreToCome;
}

/// Refuses the present request, and the session with it; always false.
bool Session::end_malformed(v1::RefusalCode code, const std::string& sentence, const char* field) {
  ++context_.counts.malformed;
  why_ended_ = sentence;
  audit("malformed", sentence, {});
  refuse(request_.id(), code, sentence, field);
  return false;
}

/// A peer that stops within a frame is gone, or never meant to send the rest.
void Session::watch_for_silence() {
  if (!greeted_) return;
  if (!reader_.in_a_frame()) return silence_.call_off();
  silence_.set(kFrameLimit, [self = shared_from_this()] { self->outbox_.cut("silent within a frame"); });
}

/// In real time a session has sent an exchange that no tick can use.
void Session::charge_excess() {
  if (engine_.config().mode != RunMode::kRealtime) return;
  refill_excess();
  ++context_.counts.excess_commands;
  excess_left_ -= 1.0;
}

void Session::refill_excess() {
  const ServerClock::time_point now = ServerClock::now();
  const auto elapsed = now - std::exchange(excess_refilled_, now);
  const auto ticks =
      static_cast<double>(elapsed.count()) / static_cast<double>(engine_.config().setup.period_ns);
  excess_left_ = std::min(excess_left_ + ticks, kExcessAtOnce);
}

/// How long this session is not to be read, so that it sends about twice as many exchanges as there are ticks
/// at most.
ServerClock::duration Session::throttle() {
  if (excess_left_ >= 0.0) return {};
  refill_excess();
  if (excess_left_ >= 0.0) return {};
  if (context_.counts.throttled++ % 1000 == 0) audit("limit", "too many commands: throttled", {});
  const double pause_ns = -excess_left_ * static_cast<double>(engine_.config().setup.period_ns);
  return std::min<ServerClock::duration>(std::chrono::nanoseconds(static_cast<std::int64_t>(pause_ns)),
                                         kLongestThrottle);
}

bool Session::handle(std::span<const std::byte> frame) {
  constexpr std::size_t kOrdinaryFrame = 4096;
  if (last_frame_ > kOrdinaryFrame)
    request_ = v1::Envelope();  // it keeps the memory of the largest frame so far
  last_frame_ = frame.size();
  if (!parse(frame, request_)) {
    request_.Clear();
    return end_malformed(v1::REFUSAL_MALFORMED, "the frame is not an Envelope", "frame");
  }
  if (!greeted_ && request_.kind_case() != v1::Envelope::kHello) {
    return end_malformed(v1::REFUSAL_UNAUTHENTICATED, "the first message must be hello", "kind");
  }
  if (greeted_ && !may_ask()) return true;
  return dispatch();
}

bool Session::dispatch() {
  switch (request_.kind_case()) {
    case v1::Envelope::kExchange:
      exchange(request_.exchange());
      break;
    case v1::Envelope::kHello:
      return greet(request_.hello());
    case v1::Envelope::kLease:
      lease(request_.lease());
      break;
    case v1::Envelope::kSubscribe:
      subscribe(request_.subscribe());
      break;
    case v1::Envelope::kReadParameters:
      read_parameters(request_.read_parameters());
      break;
    case v1::Envelope::kWriteParameter:
      write_parameter(request_.write_parameter());
      break;
    case v1::Envelope::kSetLoad:
      set_load(request_.set_load());
      break;
    case v1::Envelope::kInjectFault:
      inject_fault(request_.inject_fault());
      break;
    case v1::Envelope::kShaftBump:
      bump_shaft(request_.shaft_bump());
      break;
    case v1::Envelope::kClearFaults:
      clear_faults(request_.clear_faults());
      break;
    case v1::Envelope::kStatusRequest:
      report_status();
      break;
    case v1::Envelope::kRunExperiment:
      run_experiment(request_.run_experiment());
      break;
    case v1::Envelope::kUploadTable:
      upload_table(request_.upload_table());
      break;
    case v1::Envelope::kListExperiments:
      list_experiments(request_.list_experiments());
      break;
    case v1::Envelope::kFetchExperiment:
      fetch_experiment(request_.fetch_experiment());
      break;
    case v1::Envelope::kCancelExperiment:
      cancel_experiment(request_.cancel_experiment());
      break;
    default:
      refuse(request_.id(), v1::REFUSAL_MALFORMED, "not a request", "kind");
      break;
  }
  return true;
}

bool Session::greet(const v1::Hello& hello) {
  if (hello.protocol_min() > kProtocolVersion || hello.protocol_max() < kProtocolVersion) {
    return end_malformed(v1::REFUSAL_VERSION,
                         "this server speaks protocol " + std::to_string(kProtocolVersion) + ", the client " +
                             std::to_string(hello.protocol_min()) + " to " +
                             std::to_string(hello.protocol_max()),
                         "protocol_max");
  }
  if (hello.client().size() > 100) {
    return end_malformed(v1::REFUSAL_OUT_OF_RANGE, "the client's name is longer than 100 bytes", "client");
  }
  if (greeted_) {
    refuse(request_.id(), v1::REFUSAL_MALFORMED, "hello has been said already", "kind");
    return true;
  }
  if (!is_admitted(hello)) return false;
  greeted_ = true;
  silence_.call_off();
  reader_.set_max_payload(kMaxRequestFrame);
  watch_slot();
  audit("session_opened", "done", {{"client", hello.client()}, {"role", std::string(name_of(grant_.role))}});
  reply_.Clear();
  reply_.set_id(request_.id());
  v1::Welcome& welcome = *reply_.mutable_welcome();
  welcome.set_protocol(kProtocolVersion);
  welcome.set_build_id(std::string(build_id()));
  *welcome.mutable_bench() = describe(engine_);
  welcome.set_descriptor_set(bench_descriptor_set());
  welcome.set_role(static_cast<v1::Role>(grant_.role));
  welcome.set_subject(grant_.name);
  send(reply_);
  return true;
}

void Session::close() {
  context_.audience.remove(*this);
  slot_timer_.cancel();
  silence_.call_off();
  outbox_.close();
}

void Session::notify(v1::Notice::Kind kind, const std::string& sentence, std::uint32_t axis) {
  reply_.Clear();
  v1::Notice& notice = *reply_.mutable_notice();
  notice.set_kind(kind);
  notice.set_message(sentence);
  notice.set_axis(axis);
  send(reply_);
}

void Session::audit(std::string_view event, std::string_view result, std::vector<AuditDetail> details) {
  if (context_.audit == nullptr) return;
  context_.audit->note({.name = event, .client = &client_, .result = result, .details = std::move(details)});
}

void Session::turn_away(std::string_view sentence) {
  refuse(0, v1::REFUSAL_BUSY, std::string(sentence), "session");
}

void Session::on_newest() {
  if (!waiting_) return;
  const WaitingExchange waiting = std::move(*waiting_);
  waiting_.reset();
  reply_exchange(waiting.id, waiting.axes);
}

bool Session::send_samples() {
  bool sent = false;
  for (Subscription& s : subscriptions_) {
    while (outbox_.idle() && socket_.is_open()) {
      const std::span<const Sample> samples = s.feed->read(s.reader, kSamplesPerMessage);
      if (samples.empty()) break;
      scratch_.clear();
      append_samples(scratch_, s.axis, std::exchange(s.reader.dropped, 0), samples, s.mask);
      outbox_.send(scratch_, shared_from_this());
      sent = true;
    }
  }
  return sent;
}

void Session::reply_exchange(std::uint64_t id, std::span<const std::uint32_t> axes) {
  send_samples();  // those of a tick come before the answer that tells of it
  views_.clear();
  for (const std::uint32_t axis : axes)
    views_.push_back({axis, &engine_.newest(axis)});
  scratch_.clear();
  append_exchange_reply(scratch_, id, views_);
  outbox_.send(scratch_, shared_from_this());
}

void Session::send(const v1::Envelope& envelope) {
  const std::size_t size = envelope.ByteSizeLong();
  scratch_.resize(kFrameHeaderSize + size);
  const auto header = frame_header(static_cast<std::uint32_t>(size));
  std::copy(header.begin(), header.end(), scratch_.begin());
  envelope.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(scratch_.data()) +
                                           kFrameHeaderSize);
  replied_bytes_ += scratch_.size();
  outbox_.send(scratch_, shared_from_this());
}

void Session::give_leases_back() {
  over_ = true;
  fetch_.reset();
  tables_.clear();
  for (std::uint32_t axis = 0; axis < leased_.size(); ++axis) {
    if (!leased_[axis]) continue;
    leased_[axis] = false;
    engine_.request(
        {.tick = 0, .axis = axis, .owner = owner_, .action = LeaseAction::kLost}, [](Refused, Tick) {},
        &client_);
  }
}

}  // namespace drivebench
