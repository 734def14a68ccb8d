// What a session does for each request.
#include <algorithm>
#include <array>
#include <cmath>

#include "plant/parameters/parameters.hpp"
#include "plant/parameters/rows.hpp"
#include "protocols/text.hpp"
#include "server/endpoints/tcp/description.hpp"
#include "server/endpoints/tcp/session.hpp"
#include "server/recording/input_codec.hpp"

namespace drivebench {
namespace {

v1::RefusalCode code_of(Refused why) noexcept {
  return static_cast<v1::RefusalCode>(refusal_row(why).tcp);
}

}  // namespace

void Session::refuse(std::uint64_t id, v1::RefusalCode code, const std::string& message, const char* field) {
  reply_.Clear();
  reply_.set_id(id);
  v1::Refusal& refusal = *reply_.mutable_refusal();
  refusal.set_code(code);
  refusal.set_message(utf8(message));  // it may hold the name of a file
  refusal.set_field(field);
  send(reply_);
}

void Session::refuse(std::uint64_t id, Refused why, const char* field) {
  refuse(id, code_of(why), std::string(sentence_of(why)), field);
}

void Session::done(std::uint64_t id, Tick tick) {
  reply_.Clear();
  reply_.set_id(id);
  reply_.mutable_done()->set_tick(static_cast<std::uint64_t>(tick));
  reply_.mutable_done()->set_owner(owner_);
  send(reply_);
}

bool Session::axis_exists(std::uint32_t axis) {
  if (axis < leased_.size()) return true;
  refuse(request_.id(), v1::REFUSAL_UNKNOWN_AXIS,
         "axis " + std::to_string(axis) + " does not exist; the bench has " + std::to_string(leased_.size()),
         "axis");
  return false;
}

bool Session::may_change(std::uint32_t axis) {
  if (!axis_exists(axis)) return false;
  const Owner owner = engine_.owner(axis);
  if (engine_.config().mode == RunMode::kFree || (owner != 0 && owner == owner_)) return true;
  refuse(request_.id(), Refused::kNotOwner, "axis");
  return false;
}

bool Session::is_tick(std::uint64_t ticks, const char* field) {
  if (ticks <= kMaxTick) return true;
  refuse(request_.id(), v1::REFUSAL_OUT_OF_RANGE,
         std::string(field) + " is " + std::to_string(ticks) + " but must not exceed 2^53", field);
  return false;
}

bool Session::is_within(double value, double bound, std::string_view unit, const char* field) {
  if (std::abs(value) <= bound) return true;
  refuse(request_.id(), std::isfinite(value) ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE,
         std::string(field) + " is " + shortest(value) + " but must lie between " + shortest(-bound) +
             " and " + shortest(bound) + " " + std::string(unit),
         field);
  return false;
}

void Session::request(const Input& input, const char* field, std::function<void()> on_done) {
  engine_.request(input, answer_for(field, std::move(on_done), input.axis), &client_);
}

Engine::Answer Session::answer_for(const char* field, std::function<void()> on_done, std::uint32_t axis) {
  return [self = shared_from_this(), id = request_.id(), field, axis, on_done = std::move(on_done)](
             Refused refused, Tick tick) {
    if (refused == Refused::kOwned) return self->refuse_owned(id, axis);
    if (refused != Refused::kNot) return self->refuse(id, refused, field);
    if (on_done) on_done();
    self->done(id, tick);
  };
}

/// Says who holds the axis. A renewal this tick, which nobody could know of yet, is the latest there can be.
void Session::refuse_owned(std::uint64_t id, std::uint32_t axis) {
  const Client* const holder = engine_.client(engine_.owner(axis));
  const std::string name = holder == nullptr ? "somebody" : name_of(*holder);
  const Tick end = engine_.tick() + engine_.config().setup.lease_ticks;
  reply_.Clear();
  reply_.set_id(id);
  v1::Refusal& refusal = *reply_.mutable_refusal();
  refusal.set_code(v1::REFUSAL_OWNED);
  refusal.set_message(std::string(sentence_of(Refused::kOwned)) + ": " + name + ", until tick " +
                      std::to_string(end) + " at the latest unless it is renewed");
  refusal.set_field("axis");
  refusal.set_holder(name);
  refusal.set_lease_end_tick(static_cast<std::uint64_t>(end));
  send(reply_);
}

void Session::lease(const v1::LeaseRequest& r) {
  if (!axis_exists(r.axis())) return;
  const bool takes = r.action() == v1::LeaseRequest::ACTION_TAKE;
  if (!takes &&
      (r.action() < v1::LeaseRequest::ACTION_ACQUIRE || r.action() > v1::LeaseRequest::ACTION_RELEASE)) {
    return refuse(request_.id(), v1::REFUSAL_OUT_OF_RANGE,
                  "the action must be acquire, renew, release or take", "action");
  }
  if (engine_.config().mode == RunMode::kFree) {
    return refuse(request_.id(), Refused::kWrongMode, "action");
  }
  const auto action = takes ? LeaseAction::kAcquire : static_cast<LeaseAction>(r.action());
  const auto on_done = [this, axis = r.axis(), action] {
    leased_[axis] = action != LeaseAction::kRelease;
    taken_[axis].clear();
    if (!leased_[axis]) abandon_exchange(axis);
    if (over_) give_leases_back();  // the peer left before the bench answered
  };
  Engine::Answer answer = [this, answered = answer_for("axis", on_done, r.axis())](Refused refused,
                                                                                   Tick tick) {
    --leases_in_flight_;
    answered(refused, tick);
  };
  if (takes) return take(r, std::move(answer));
  if (owner_ == 0) owner_ = engine_.new_owner(client_);
  ++leases_in_flight_;
  engine_.request({.tick = 0, .axis = r.axis(), .owner = owner_, .action = action}, std::move(answer),
                  &client_);
}

/// An exchange that waits for a tick of an axis that has just been released would wait for ever.
void Session::abandon_exchange(std::uint32_t axis) {
  if (!waiting_ || std::find(waiting_->axes.begin(), waiting_->axes.end(), axis) == waiting_->axes.end())
    return;
  const std::uint64_t id = waiting_->id;
  waiting_.reset();
  refuse(id, v1::REFUSAL_NOT_OWNER, not_owner_of(axis), "commands");
}

std::string Session::not_owner_of(std::uint32_t axis) const {
  const std::string sentence(sentence_of(Refused::kNotOwner));
  return taken_[axis].empty() ? sentence : sentence + ": " + taken_[axis];
}

void Session::exchange(const v1::Exchange& r) {
  const std::uint64_t id = request_.id();
  if (waiting_) {
    charge_excess();
    return refuse(id, v1::REFUSAL_BUSY, "an exchange of this session is still waiting for its tick",
                  "commands");
  }
  WaitingExchange waiting{.id = id, .axes = {}};
  if (r.commands().empty()) {
    for (std::uint32_t axis = 0; axis < leased_.size(); ++axis)
      waiting.axes.push_back(axis);
    return reply_exchange(id, waiting.axes);
  }
  for (const v1::Command& command : r.commands()) {
    if (!axis_exists(command.axis())) return;
    if (std::find(waiting.axes.begin(), waiting.axes.end(), command.axis()) != waiting.axes.end()) {
      return refuse(id, v1::REFUSAL_OUT_OF_RANGE, "two commands for one axis", "commands.axis");
    }
    if (!decode_command(command)) {
      return refuse(id, v1::REFUSAL_OUT_OF_RANGE,
                    "gates is " + std::to_string(command.gates()) + " but must be 0 to 3", "commands.gates");
    }
    waiting.axes.push_back(command.axis());
  }
  // All or none: a command that was taken would bar its axis from the next try.
  for (const v1::Command& command : r.commands()) {
    if (engine_.check(command.axis(), owner_, *decode_command(command)) == Refused::kNot) continue;
    const Refused why = engine_.command(command.axis(), owner_, *decode_command(command));
    charge_excess();
    const std::string sentence =
        why == Refused::kNotOwner ? not_owner_of(command.axis()) : std::string(sentence_of(why));
    return refuse(id, code_of(why), sentence + " (axis " + std::to_string(command.axis()) + ")",
                  why == Refused::kWrongDrive ? "commands.gates" : "commands");
  }
  for (const v1::Command& command : r.commands())
    engine_.command(command.axis(), owner_, *decode_command(command));
  waiting_ = std::move(waiting);
  context_.audience.add_waiting(*this);
  engine_.advance();
}

void Session::subscribe(const v1::Subscribe& r) {
  if (!axis_exists(r.axis())) return;
  SignalMask mask = r.signals().empty() ? kAllSignals : 0;
  for (const std::string& name : r.signals()) {
    const Signal* signal = find_signal(name);
    if (signal == nullptr) {
      return refuse(request_.id(), v1::REFUSAL_UNKNOWN_SIGNAL, "there is no signal '" + printable(name) + "'",
                    "signals");
    }
    mask |= SignalMask{1} << (signal - kSignals.data());
  }
  std::erase_if(subscriptions_, [&](const Subscription& s) { return s.axis == r.axis(); });
  if (r.decimation() > 0) {
    std::shared_ptr<const SampleFeed> feed = context_.audience.feed(r.axis(), r.decimation());
    const SampleFeed::Reader reader = feed->reader();
    subscriptions_.push_back({.axis = r.axis(), .mask = mask, .feed = std::move(feed), .reader = reader});
  }
  if (subscriptions_.empty()) {
    context_.audience.remove_subscriber(*this);
  } else {
    context_.audience.add_subscriber(*this);
  }
  done(request_.id(), engine_.tick());
}

void Session::read_parameters(const v1::ReadParameters& r) {
  if (!axis_exists(r.axis())) return;
  reply_.Clear();
  reply_.set_id(request_.id());
  v1::ParameterValues& values = *reply_.mutable_parameter_values();
  const std::span<const Parameter> table = axis_parameters(engine_.parameters(r.axis()));
  if (static_cast<std::size_t>(r.names_size()) > table.size()) {
    return refuse(request_.id(), v1::REFUSAL_OUT_OF_RANGE,
                  std::to_string(r.names_size()) + " names, but the axis has " +
                      std::to_string(table.size()) + " parameters",
                  "names");
  }
  for (const std::string& name : r.names()) {
    const Parameter* row = find_parameter(engine_.parameters(r.axis()), name);
    if (row == nullptr) {
      return refuse(request_.id(), v1::REFUSAL_UNKNOWN_PARAMETER,
                    "there is no parameter '" + printable(name) + "'", "names");
    }
    *values.add_parameters() =
        describe_parameter(engine_, r.axis(), static_cast<std::size_t>(row - table.data()));
  }
  for (std::size_t row = 0; r.names().empty() && row < table.size(); ++row) {
    *values.add_parameters() = describe_parameter(engine_, r.axis(), row);
  }
  send(reply_);
}

void Session::write_parameter(const v1::WriteParameter& r) {
  if (!may_change(r.axis())) return;
  const AxisParameters& p = engine_.parameters(r.axis());
  const Parameter* row = find_parameter(p, r.name());
  if (row == nullptr) {
    return refuse(request_.id(), v1::REFUSAL_UNKNOWN_PARAMETER,
                  "there is no parameter '" + printable(r.name()) + "'", "name");
  }
  if (!row->live) {
    return refuse(request_.id(), v1::REFUSAL_READ_ONLY, r.name() + " cannot be changed while the bench runs",
                  "name");
  }
  if (!is_tick(r.ramp_ticks(), "ramp_ticks") || !is_tick(r.at_tick(), "at_tick")) return;
  if (row->integer && r.ramp_ticks() != 0) {
    return refuse(request_.id(), v1::REFUSAL_OUT_OF_RANGE,
                  "ramp_ticks is " + std::to_string(r.ramp_ticks()) + " but must be 0: " + r.name() +
                      " has no values in between",
                  "ramp_ticks");
  }
  const auto index = static_cast<std::uint32_t>(row - axis_parameters(p).data());
  const auto at_tick = static_cast<Tick>(r.at_tick());
  const bool later = at_tick > engine_.tick();
  if (const std::string problem = later ? engine_.problem_with_value(r.axis(), index, r.value())
                                        : engine_.try_parameter(r.axis(), index, r.value());
      !problem.empty()) {
    const bool finite = std::isfinite(r.value());
    return refuse(request_.id(), finite ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE,
                  r.name() + " " + problem, "value");
  }
  const ParameterWrite write{
      .row = index, .value = r.value(), .ramp_ticks = static_cast<Tick>(r.ramp_ticks())};
  request({.tick = at_tick, .axis = r.axis(), .owner = owner_, .action = write}, "name");
}

void Session::set_load(const v1::SetLoad& r) {
  if (!may_change(r.axis())) return;
  if (!is_within(r.load_nm(), kMaxLoadNm, "N*m", "load_nm")) return;
  if (!is_tick(r.ramp_ticks(), "ramp_ticks") || !is_tick(r.at_tick(), "at_tick")) return;
  const LoadChange change{.load_nm = r.load_nm(), .ramp_ticks = static_cast<Tick>(r.ramp_ticks())};
  request({.tick = static_cast<Tick>(r.at_tick()), .axis = r.axis(), .owner = owner_, .action = change},
          "at_tick");
}

void Session::inject_fault(const v1::InjectFault& r) {
  if (!may_change(r.axis())) return;
  const std::size_t row = find_injectable_fault(r.name());
  if (row == kInjectableFaultCount) {
    return refuse(request_.id(), v1::REFUSAL_UNKNOWN_FAULT, "there is no fault '" + printable(r.name()) + "'",
                  "name");
  }
  if (const std::string problem = problem_with(kInjectableFaults[row], r.value()); !problem.empty()) {
    const bool finite = std::isfinite(r.value());
    return refuse(request_.id(), finite ? v1::REFUSAL_OUT_OF_RANGE : v1::REFUSAL_NOT_FINITE,
                  r.name() + " " + problem, "value");
  }
  if (!is_tick(r.at_tick(), "at_tick")) return;
  const InjectFault fault{.row = static_cast<std::uint32_t>(row), .value = r.value()};
  request({.tick = static_cast<Tick>(r.at_tick()), .axis = r.axis(), .owner = owner_, .action = fault},
          "at_tick");
}

void Session::bump_shaft(const v1::ShaftBump& r) {
  if (!may_change(r.axis())) return;
  if (!is_within(r.impulse_nms(), kMaxImpulseNms, "N*m*s", "impulse_nms") ||
      !is_tick(r.at_tick(), "at_tick")) {
    return;
  }
  request({.tick = static_cast<Tick>(r.at_tick()),
           .axis = r.axis(),
           .owner = owner_,
           .action = ShaftBump{r.impulse_nms()}},
          "at_tick");
}

void Session::clear_faults(const v1::ClearFaults& r) {
  if (!axis_exists(r.axis())) return;
  request({.tick = 0, .axis = r.axis(), .owner = owner_, .action = ClearFaults{}}, "axis");
}

void Session::report_status() {
  reply_.Clear();
  reply_.set_id(request_.id());
  v1::Status& status = *reply_.mutable_status();
  status.set_mode(wire_mode(engine_.config().mode));
  status.set_tick(static_cast<std::uint64_t>(engine_.tick()));
  status.set_late_ticks(engine_.newest(0).late_ticks);
  status.set_worst_lateness_s(static_cast<double>(engine_.worst_lateness_ns()) * 1e-9);
  status.set_sessions(static_cast<std::uint32_t>(context_.session_count()));
  if (const Recorder* recorder = engine_.recorder()) {
    status.set_recording(utf8(recorder->file()));
    status.set_recording_gaps(recorder->gaps());
    status.set_recording_over(recorder->is_over());
  }
  for (std::uint32_t axis = 0; axis < leased_.size(); ++axis) {
    std::array<std::byte, kMaxSampleBytes> bytes;
    Sample now = engine_.newest(axis);
    now.owner = engine_.owner(axis);  // in lockstep it may have changed while time stood still
    const std::size_t size = encode_sample(now, kAllSignals, bytes.data());
    v1::AxisSample& sample = *status.add_axes();
    sample.set_axis(axis);
    sample.mutable_sample()->ParseFromArray(bytes.data(), static_cast<int>(size));
  }
  status.set_state_hash(engine_.state_hash());
  for (const std::string& note : engine_.notes())
    status.add_notes(note);
  for (const TransportReport& report : context_.transports()) {
    v1::TransportStatus& transport = *status.add_transports();
    transport.set_name(report.name);
    transport.set_state(report.state);
    for (const auto& [name, value] : report.counts) {
      v1::TransportStatus::Count& count = *transport.add_counts();
      count.set_name(std::string(name));
      count.set_value(value);
    }
  }
  send(reply_);
}

}  // namespace drivebench
