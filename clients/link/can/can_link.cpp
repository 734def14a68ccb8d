#include "clients/link/can/can_link.hpp"

#include <algorithm>
#include <array>
#include <random>
#include <utility>

#include "clients/link/can/can_versions.hpp"

namespace drivebench::link {
namespace {

using can::index_of;
using can::Message;
using can::Request;
using can::Result;

constexpr unsigned kModeLockstep = 1;
constexpr unsigned kStopped = 4;  // of a heartbeat

[[noreturn]] void refuse_with(Result result) {
  const RefusalRow& meaning = refusal_meant_by(&RefusalRow::can, result, drivebench::Refused::kMalformed);
  refuse(static_cast<v1::RefusalCode>(meaning.tcp), meaning.sentence);
}

constexpr SignalMask signals_of(const can::MessageRow& row) {
  SignalMask mask = 0;
  for (const can::Field& field : row.fields) {
    for (std::size_t i = 0; i < kSignals.size(); ++i) {
      if (!field.signal.empty() && kSignals[i].name == field.signal) mask |= SignalMask{1} << i;
    }
  }
  return mask;
}

/// The signals in the frames of sensors and state, without the speed, which the state frame does not carry
/// for every sample.
SignalMask signals_in(const can::Profile& profile) {
  SignalMask mask = 0;
  for (const can::MessageRow& row : can::kMessages) {
    if (can::is_on(row, profile) && row.sender == can::Sender::kBench) mask |= signals_of(row);
  }
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    if (kSignals[i].kind == SignalKind::kTruth) mask &= ~(SignalMask{1} << i);
  }
  return mask;
}

/// The value of an unsigned field of at most 32 bits.
std::uint32_t as_code(double value) {
  return static_cast<std::uint32_t>(value);
}

}  // namespace

CanLink::CanLink(const CanAddress& address, const CanLinkOptions& options)
    : CanLink(open_can_bus(address, options.deadline, heard_ids(address)), address, to_string(address),
              options) {}

CanLink::CanLink(std::unique_ptr<CanBus> bus, const CanAddress& address, std::string name,
                 const CanLinkOptions& options)
    : bus_(std::move(bus)),
      profile_(address.profile),
      node_(address.node),
      name_(std::move(name)),
      options_(options),
      known_(signals_in(address.profile)),
      controller_(std::random_device{}()) {
  bench_.set_name(name_);
  bench_.add_axes()->set_name("node " + std::to_string(node_));
  try {
    await(
        "heartbeat", [this] { return bench_.period_s() > 0.0; }, [] {});
  } catch (const LinkError& error) {
    throw ConnectError(error.what());
  }
}

CanLink::~CanLink() {
  if (lease_ == 0) return;
  try {
    send_request(Request::kRelease);  // CAN has no connection whose end would release it
  } catch (const LinkError&) {
    return;  // the lease runs out
  }
}

void CanLink::acquire() {
  const Reply reply = ask(Request::kAcquire);
  if (reply.result != Result::kDone) refuse_with(reply.result);
  if (reply.lease == 0) throw LinkError(name_ + " gave the axis without a lease number");
  lease_ = reply.lease;
  // After the request the bench sends state and sample, so that a controller can join a waiting lockstep
  // bench.
  await(
      "state and sample after the request",
      [this] {
        const bool has_all = has_state_ && (profile_.fd || has_counters_);
        return has_all && has_sample_ && bench_.mode() != v1::MODE_UNSPECIFIED;
      },
      [this] { send_request(Request::kAcquire); });
}

void CanLink::release() {
  const Reply reply = ask(Request::kRelease);
  lease_ = 0;
  if (reply.result != Result::kDone) refuse_with(reply.result);
}

void CanLink::clear_faults() {
  const Reply reply = ask(Request::kClearFaults);
  if (reply.result != Result::kDone) refuse_with(reply.result);
}

void CanLink::write_parameter(std::string_view name, double) {
  refuse(v1::REFUSAL_READ_ONLY, "parameters cannot be written over CAN", name);
}

void CanLink::set_load(const LoadChange&) {
  refuse(v1::REFUSAL_READ_ONLY, "the load cannot be set over CAN", "load");
}

const Sample& CanLink::newest() {
  constexpr int kMostWaiting = 10'000;  // bounds the loop on a bus that is never silent
  for (int i = 0; i < kMostWaiting && receive(Clock::time_point::min()); ++i) {
  }
  await(
      "sample", [this] { return has_sample_; }, [] {});
  return sample_;
}

can::CommandFrames CanLink::frames_of(const AxisCommand& command) const {
  const Setpoints x = setpoints_of(command);
  if ((x.c != 0.0 || x.f != 0.0) && !profile_.wide) {
    refuse(v1::REFUSAL_OUT_OF_RANGE, "over CAN this axis has neither a phase c nor a field", "command");
  }
  return can::encode_command(profile_, node_, profile_.wide,
                             {.tick = command.tick,
                              .mode = can_mode_of(command.gates),
                              .lease = lease_,
                              .legs_off = command.legs_off,
                              .a = x.a,
                              .b = x.b,
                              .c = x.c,
                              .field = x.f});
}

const Sample& CanLink::exchange(const AxisCommand& command) {
  const can::CommandFrames frames = frames_of(command);
  const auto send = [this, &frames] {
    for (const can::Frame& frame : frames)
      bus_->send(frame);
  };
  const std::uint64_t tick = command.tick;
  commanded_tick_ = tick;
  command_result_.reset();
  asked_ = Request::kCommand;
  reply_.reset();
  send();
  await(
      "sample after tick " + std::to_string(tick),
      [this, tick] {
        check_replies();
        return has_sample_ && sample_.tick > tick;
      },
      [this, &send] {
        if (is_lockstep()) send();
      });
  // In real time a slow controller continues with the newest sample.
  while (!is_lockstep() && receive(Clock::time_point::min())) {
  }
  return sample_;
}

/// Handles replies while a command waits for its sample.
void CanLink::check_replies() {
  if (reply_ && reply_->result != Result::kDone) refuse_with(reply_->result);
  if (!command_result_) return;
  const Result result = *std::exchange(command_result_, std::nullopt);
  if (result == Result::kIncomplete)
    return;  // one of the two frames was lost; in lockstep both are sent again
  if (result == Result::kNotOwner) {
    send_request(
        Request::kRenew);  // the refusal may be about another controller; the reply to this request is not
  } else if (result != Result::kStale) {
    refuse_with(result);
  } else if (is_lockstep()) {
    // The command was repeated, or the network doubled it: the sample that answered it was lost. A request
    // for the lease by the controller that holds it brings the newest one.
    send_request(Request::kAcquire);
  }
}

CanLink::Reply CanLink::ask(Request request) {
  bool repeated = false;
  reply_.reset();
  send_request(request);
  await(
      "reply to request " + std::to_string(static_cast<unsigned>(request)),
      [this] { return reply_.has_value(); },
      [this, request, &repeated] {
        repeated = true;
        send_request(request);
      });
  asked_ = Request::kCommand;
  Reply reply = *std::exchange(reply_, std::nullopt);
  if (request == Request::kRelease && repeated && reply.result == Result::kNotOwner)
    reply.result = Result::kDone;
  return reply;
}

void CanLink::send_request(Request request) {
  asked_ = request;
  const can::MessageRow& row = *can::find_message(Message::kRequest, profile_.fd);
  const std::array<double, 3> values = {static_cast<double>(request),
                                        static_cast<double>(request == Request::kAcquire ? 0 : lease_),
                                        static_cast<double>(controller_)};
  bus_->send(can::encode(row, profile_, node_, values));
}

template <class Done, class Repeat>
void CanLink::await(const std::string& what, Done done, Repeat repeat) {
  if (done()) return;
  const Clock::time_point give_up = Clock::now() + options_.deadline;
  Clock::time_point again = Clock::now() + options_.repeat_after;
  for (;;) {
    const bool received = receive(std::min(again, give_up));
    if (received && done()) return;
    const Clock::time_point now = Clock::now();
    if (now >= give_up) {
      std::string text = name_ + " sent no " + what + " of node " + std::to_string(node_) + " within " +
                         std::to_string(options_.deadline.count()) + " ms";
      if (misfit_ != can::FrameProblem::kNone) {
        text += "; its frames have another form (" + std::string(can::name_of(misfit_)) +
                "): do both ends agree on fd, extended and the identifiers?";
      }
      if (other_version_ != 0) text += "; it " + other_version_text(other_version_, profile_);
      throw LinkError(text);
    }
    if (received) continue;
    repeat();
    again = now + options_.repeat_after;
  }
}

bool CanLink::receive(Clock::time_point until) {
  const std::optional<can::Frame> frame = bus_->receive(until);
  if (!frame) return false;
  const can::Match match = can::match(profile_, *frame);
  const bool is_mine = match.row != nullptr && match.row->sender == can::Sender::kBench &&
                       (!match.row->per_node || match.node == node_);
  if (!is_mine) {
    if (bench_.period_s() == 0.0) {
      other_version_ = other_version_in(*frame, profile_, node_).value_or(other_version_);
    }
    return true;
  }
  if (match.ok()) {
    take(*match.row, can::decode(*match.row, profile_, *frame));
  } else {
    misfit_ = match.problem;
  }
  return true;
}

void CanLink::take(const can::MessageRow& row, const can::Values& values) {
  switch (row.message) {
    case Message::kHeartbeat:
      return take_heartbeat(values);
    case Message::kReply:
      return take_reply(values);
    case Message::kEncoder:
      can::update_sample(row, values, coming_);
      has_encoder_ = true;
      return;
    case Message::kPhases:
      can::update_sample(row, values, coming_);
      has_phases_ = true;
      return;
    case Message::kCurrents: {
      can::update_sample(row, values, coming_);
      // Without the other frames the sample is incomplete: the count or a current would be old.
      const bool has_phases = std::exchange(has_phases_, false) || !profile_.wide;
      if (std::exchange(has_encoder_, false) && has_phases) take_sample();
      return;
    }
    case Message::kSensors:
      can::update_sample(row, values, coming_);
      return take_sample();
    case Message::kSync:
      bench_.set_mode(as_code(values[index_of(Message::kSync, true, "mode")]) == kModeLockstep
                          ? v1::MODE_LOCKSTEP
                          : v1::MODE_REALTIME);
      return take_sync_tick(as_code(values[index_of(Message::kSync, true, "tick")]));
    default:
      break;
  }
  // The page of the speed sensors belongs to the next sample.
  const bool is_part = row.message == Message::kDetails && can::is_paged(row) &&
                       as_code(values[0]) == static_cast<unsigned>(can::Page::kSpeedSensors);
  has_state_ |= row.message == Message::kState;
  has_counters_ |= row.message == Message::kCounters;
  // A tick in these frames is their own; the sample keeps the tick of its sensors.
  for (Sample* const sample : {&coming_, &sample_}) {
    if (is_part && sample == &sample_) continue;
    const std::uint64_t tick = sample->tick;
    can::update_sample(row, values, *sample);
    sample->tick = tick;
  }
}

void CanLink::take_heartbeat(const can::Values& values) {
  const auto field = [&values](std::string_view name) {
    return values[index_of(Message::kHeartbeat, true, name)];
  };
  const unsigned version = as_code(field("profile"));
  const bool is_wide = version == can::version_of(profile_.id_set, true);
  if (!is_wide && version != can::version_of(profile_.id_set, false)) {
    throw LinkError(name_ + " " + other_version_text(version, profile_));
  }
  if (as_code(field("state")) == kStopped) throw LinkError(name_ + " has stopped");
  profile_.wide = is_wide;
  known_ = signals_in(profile_);
  bench_.set_period_s(field("period_us") * 1e-6);
}

/// The currents frame has 16 bits of the tick, SYNC has 32. If both are of one tick, the sample gets the
/// other 16 bits.
void CanLink::take_sync_tick(std::uint32_t tick) {
  const bool is_of_sample = has_sample_ && (tick & 0xFFFF) == (sample_.tick & 0xFFFF);
  if (profile_.fd || !is_of_sample) return;
  const std::int64_t nearest = can::unwrap(tick, 32, static_cast<std::int64_t>(sample_.tick));
  coming_.tick = sample_.tick = nearest < 0 ? tick : static_cast<std::uint64_t>(nearest);
}

void CanLink::take_reply(const can::Values& values) {
  const auto field = [&values](std::string_view name) {
    return values[index_of(Message::kReply, true, name)];
  };
  const auto request = static_cast<Request>(as_code(field("request")));
  const Reply reply = {.result = static_cast<Result>(as_code(field("result"))),
                       .lease = as_code(field("lease"))};
  if (request == Request::kCommand) {
    if (as_code(field("tick")) == (commanded_tick_ & 0xFF)) command_result_ = reply.result;
  } else if (request == asked_ && as_code(field("controller")) == controller_) {
    reply_ = reply;
  }
}

void CanLink::take_sample() {
  // No SYNC since the previous sample: the bench runs in real time.
  if (bench_.mode() == v1::MODE_UNSPECIFIED && has_sample_ && coming_.tick != sample_.tick) {
    bench_.set_mode(v1::MODE_REALTIME);
  }
  sample_ = coming_;
  has_sample_ = true;
}

}  // namespace drivebench::link
