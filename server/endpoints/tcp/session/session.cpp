#include "server/endpoints/tcp/session/session.hpp"

#include "protocols/descriptor_set.hpp"
#include "server/endpoints/tcp/session/request_bounds.hpp"
#include "server/endpoints/tcp/session/requests/changes.hpp"
#include "server/endpoints/tcp/session/requests/experiment_requests.hpp"
#include "server/endpoints/tcp/session/requests/reports.hpp"
#include "server/host/build_id.hpp"

namespace drivebench {
namespace {

constexpr std::uint32_t kProtocolVersion = 1;

v1::Role wire_role(Role role) noexcept {
  switch (role) {
    case Role::kViewer:
      return v1::ROLE_VIEWER;
    case Role::kOperator:
      return v1::ROLE_OPERATOR;
    case Role::kConductor:
      return v1::ROLE_CONDUCTOR;
    case Role::kAdmin:
      break;
  }
  return v1::ROLE_ADMIN;
}

}  // namespace

Session::Session(Outbox::Socket socket, Client client, SessionContext& context, Places::Number place)
    : dialogue_(std::move(socket), std::move(client), context, [this] { return shared_from_this(); }),
      identity_(dialogue_),
      subscriptions_(dialogue_),
      trigger_(dialogue_),
      leases_(dialogue_),
      exchanges_(dialogue_, leases_, subscriptions_),
      shared_exchanges_(dialogue_, exchanges_),
      gate_level_(dialogue_),
      states_(dialogue_, leases_),
      uploads_(dialogue_),
      fetch_(dialogue_),
      place_(place),
      reader_(kMaxRequestFrame),
      silence_(dialogue_.socket().get_executor()) {
  reader_.set_max_payload(kMaxFrameBeforeHello);
  identity_.on_end = [this](const std::string& sentence) { end(sentence); };
  leases_.on_gone = [this](std::uint32_t axis) { exchanges_.abandon(axis); };
  dialogue_.outbox().on_idle = [this] {
    subscriptions_.send_samples();
    fetch_.go_on();
  };
  dialogue_.outbox().on_cut = [this](std::string_view why) {
    ++dialogue_.context().counts.cut;
    why_ended_ = why;
    dialogue_.report("limit", "cut off", why);
  };
}

asio::awaitable<void> Session::run() {
  const std::shared_ptr<Session> self = shared_from_this();
  Outbox::Socket& socket = dialogue_.socket();
  ServerTimer timer(socket.get_executor());
  silence_.set(kHelloLimit, [self] { self->dialogue_.outbox().cut("no hello within 2 s"); });
  boost::system::error_code error;
  Turn turn = Turn::kAll;
  while (turn != Turn::kOver && !error) {
    const std::span<std::byte> space = reader_.free_space();
    const std::size_t count = co_await socket.async_read_some(
        asio::buffer(space.data(), space.size()), asio::redirect_error(asio::use_awaitable, error));
    if (!greeted_ && count > 0) dialogue_.context().places.heard(place_);
    reader_.received(count);
    while ((turn = take_turn()) == Turn::kMoreToCome) {
      co_await asio::post(socket.get_executor(), asio::use_awaitable);
      if (const auto pause = due_pause(); pause > pause.zero()) co_await rest(timer, pause);
    }
    watch_for_silence();
    if (turn == Turn::kOver) continue;
    if (const auto pause = due_pause(); pause > pause.zero()) co_await rest(timer, pause);
  }
  timer.cancel();
  if (error) dialogue_.outbox().lose(error);
  if (greeted_) dialogue_.audit("session_ended", "done", {{"reason", why_ended_}});
  over_ = true;
  fetch_.drop();
  uploads_.clear();
  leases_.lose_all();
  close();
}

/// The pause of a session that asked for more than it may.
ServerClock::duration Session::due_pause() {
  return std::max(exchanges_.excess().pause(), identity_.pause());
}

/// Does not read the session for a while.
asio::awaitable<void> Session::rest(ServerTimer& timer, ServerClock::duration pause) {
  silence_.call_off();
  timer.expires_after(pause);
  boost::system::error_code cancelled;
  co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, cancelled));
  watch_for_silence();
}

/// Answers the requests that have arrived, up to the limits of a turn, so that the other clients need not
/// wait for a client with many requests.
Session::Turn Session::take_turn() {
  dialogue_.begin_turn();
  for (int n = 0; n < kRequestsPerTurn && dialogue_.bytes_in_turn() < kReplyBytesPerTurn; ++n) {
    if (!dialogue_.socket().is_open()) return Turn::kOver;
    if (identity_.must_pause()) break;
    const auto frame = reader_.next();
    if (frame && handle(*frame)) continue;
    if (frame) return Turn::kOver;
    if (reader_.error().empty()) return Turn::kAll;
    dialogue_.begin_request(0);
    end_malformed(v1::REFUSAL_MALFORMED, std::string(reader_.error()), "frame");
    return Turn::kOver;
  }
  return Turn::kMoreToCome;
}

/// Refuses the request and ends the session with it; always false.
bool Session::end_malformed(v1::RefusalCode code, const std::string& sentence, const char* field) {
  ++dialogue_.context().counts.malformed;
  why_ended_ = sentence;
  dialogue_.report("malformed", "malformed", sentence);
  dialogue_.refuse(dialogue_.id(), code, sentence, field);
  return false;
}

/// Cuts off a peer that is silent within a frame: it has gone, or never meant to send the rest.
void Session::watch_for_silence() {
  if (!greeted_) return;
  if (!reader_.in_a_frame()) return silence_.call_off();
  silence_.set(kFrameLimit,
               [self = shared_from_this()] { self->dialogue_.outbox().cut("silent within a frame"); });
}

bool Session::handle(std::span<const std::byte> frame) {
  using Outcome = FrameReading::Outcome;
  v1::Envelope request;  // its memory goes back with the answer
  const FrameReading reading = read_request(frame, request);
  dialogue_.begin_request(reading.id);
  const bool is_envelope = reading.outcome != Outcome::kNoEnvelope;
  if (is_envelope && !greeted_ && reading.kind != v1::Envelope::kHello) {
    return end_malformed(v1::REFUSAL_UNAUTHENTICATED, "the first message must be hello", "kind");
  }
  if (!is_envelope || (!greeted_ && reading.outcome == Outcome::kRefused)) {
    return end_malformed(reading.code, reading.sentence, reading.field.c_str());
  }
  if (reading.outcome == Outcome::kRefused) {
    dialogue_.refuse(reading.id, reading.code, reading.sentence, reading.field.c_str());
    return true;
  }
  if (greeted_ && !identity_.may_ask(request)) return true;
  return dispatch(request);
}

/// False: the session is over.
bool Session::dispatch(const v1::Envelope& request) {
  switch (request.kind_case()) {
    case v1::Envelope::kExchange:
      exchanges_.exchange(request.exchange());
      break;
    case v1::Envelope::kHello:
      return greet(request.hello());
    case v1::Envelope::kLease:
      leases_.lease(request.lease());
      break;
    case v1::Envelope::kSubscribe:
      subscriptions_.subscribe(request.subscribe());
      break;
    case v1::Envelope::kTrigger:
      trigger_.set(request.trigger());
      break;
    case v1::Envelope::kReadCapture:
      trigger_.read(request.read_capture());
      break;
    case v1::Envelope::kReadParameters:
      report_parameters(dialogue_, request.read_parameters());
      break;
    case v1::Envelope::kWriteParameter:
      write_parameter(dialogue_, leases_, request.write_parameter());
      break;
    case v1::Envelope::kSetLoad:
      set_load(dialogue_, leases_, request.set_load());
      break;
    case v1::Envelope::kInjectFault:
      inject_fault(dialogue_, leases_, request.inject_fault());
      break;
    case v1::Envelope::kShaftBump:
      bump_shaft(dialogue_, leases_, request.shaft_bump());
      break;
    case v1::Envelope::kClearFaults:
      clear_faults(dialogue_, leases_, request.clear_faults());
      break;
    case v1::Envelope::kSaveState:
      states_.save();
      break;
    case v1::Envelope::kRestoreState:
      states_.restore(request.restore_state());
      break;
    case v1::Envelope::kResetBench:
      states_.reset();
      break;
    case v1::Envelope::kShareMemory:
      shared_exchanges_.share(request.share_memory());
      break;
    case v1::Envelope::kShareBridge:
      gate_level_.share(request.share_bridge());
      break;
    case v1::Envelope::kStatusRequest:
      report_status(dialogue_);
      break;
    case v1::Envelope::kRunExperiment:
      run_experiment(
          dialogue_, [this](std::uint64_t table) { return uploads_.find(table); }, request.run_experiment());
      break;
    case v1::Envelope::kUploadTable:
      uploads_.upload(request.upload_table());
      break;
    case v1::Envelope::kListExperiments:
      list_experiments(dialogue_, request.list_experiments());
      break;
    case v1::Envelope::kFetchExperiment:
      fetch_.begin(request.fetch_experiment());
      break;
    case v1::Envelope::kCancelExperiment:
      cancel_experiment(dialogue_, request.cancel_experiment());
      break;
    default:  // read_request() has refused it
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
    dialogue_.refuse(dialogue_.id(), v1::REFUSAL_MALFORMED, "hello has been said already", "kind");
    return true;
  }
  if (!identity_.admit(hello)) return false;
  const std::string full = dialogue_.context().places.admit(place_, identity_.grant().role);
  if (!full.empty()) return end_without_place(full);
  greeted_ = true;
  silence_.call_off();
  reader_.set_max_payload(kMaxRequestFrame);
  identity_.watch_slot();
  dialogue_.audit("session_opened", "done",
                  {{"client", hello.client()}, {"role", std::string(name_of(identity_.grant().role))}});
  welcome();
  return true;
}

void Session::welcome() {
  v1::Welcome& welcome = *dialogue_.begin_reply(dialogue_.id()).mutable_welcome();
  welcome.set_protocol(kProtocolVersion);
  welcome.set_build_id(std::string(build_id()));
  *welcome.mutable_bench() = describe(dialogue_.engine());
  welcome.set_descriptor_set(bench_descriptor_set());
  welcome.set_role(wire_role(identity_.grant().role));
  welcome.set_subject(identity_.grant().name);
  dialogue_.send_reply();
}

void Session::on_new_grants() {
  if (greeted_ && !over_) identity_.look_again();
}

/// Refuses the request and ends the session with it; always false.
bool Session::end_without_place(const std::string& sentence) {
  ++dialogue_.context().counts.turned_away;
  dialogue_.report("limit", "turned away", sentence);
  dialogue_.refuse(dialogue_.id(), v1::REFUSAL_BUSY, sentence, "session");
  return false;
}

void Session::turn_away(const std::string& sentence) {
  if (!dialogue_.socket().is_open()) return;
  dialogue_.begin_request(0);
  end_without_place(sentence);
  close();
}

void Session::end(const std::string& sentence) {
  why_ended_ = sentence;
  dialogue_.notify(v1::Notice::KIND_SESSION_ENDED, sentence, 0);
  close();
}

void Session::close() {
  Audience& audience = dialogue_.context().audience;
  audience.remove_subscriber(subscriptions_);
  audience.remove_waiting(exchanges_);
  trigger_.end();
  identity_.stop_watching();
  silence_.call_off();
  dialogue_.context().places.leave(place_);
  dialogue_.outbox().close();
  shared_exchanges_.close();
  gate_level_.close();
}

}  // namespace drivebench
