#include "server/endpoints/can/endpoint.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "server/host/logging/log.hpp"

namespace drivebench::can {
namespace {

// As fine as the shortest time-out of the configuration.
constexpr auto kTimerPeriod = std::chrono::milliseconds(10);

/// The clock of the stamps may be set back at any time.
constexpr std::uint64_t not_negative(std::int64_t value) noexcept {
  return value > 0 ? static_cast<std::uint64_t>(value) : 0;
}

/// The value of a field that holds an unsigned number.
constexpr std::uint64_t unsigned_of(double value) noexcept {
  return value > 0.0 ? static_cast<std::uint64_t>(value) : 0;
}

/// Whether a message with these identifiers comes from a bench.
bool from_bench(const Match& match) noexcept {
  return match.row != nullptr && match.row->sender == Sender::kBench;
}

}  // namespace

std::string_view name_of(BusState state) noexcept {
  switch (state) {
    case BusState::kUp:
      return "up";
    case BusState::kWarning:
      return "error warning";
    case BusState::kPassive:
      return "error passive";
    case BusState::kDown:
      return "CAN_DOWN";
    case BusState::kAbsent:
      break;
  }
  return "CAN_ABSENT";
}

Endpoint::Endpoint(asio::io_context& io, const CanConfig& config, std::unique_ptr<Bus> bus)
    : timer_(io), config_(config), bus_(std::move(bus)) {}

void Endpoint::serve(Engine& engine, Audit* audit) {
  engine_ = &engine;
  audit_ = audit;
  std::vector<std::uint32_t> ids;
  for (std::uint32_t axis = 0; axis < engine.config().axes.size(); ++axis) {
    nodes_.push_back({.axis = axis,
                      .id = engine.config().axes[axis].can_node,
                      .terminals = terminals_of(engine.parameters(axis)),
                      .seat = Seat(engine, axis)});
    config_.profile.wide |= nodes_.back().wide();
    nodes_.back().index_tick = engine.newest(axis).index_tick;
  }
  for (const Node& node : nodes_) {
    for (const MessageRow& row : kMessages) {
      const std::uint32_t id = config_.profile.id_of(row, node.id);
      if (row.width == Width::kWide && !node.wide()) continue;
      if (std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(id);
    }
  }
  bus_->on_frame = [this](const Frame& frame, std::int64_t stamp_ns) { on_frame(frame, stamp_ns); };
  bus_->on_state = [this] { on_state(); };
  bus_->on_refused = [this](const std::string& peer, std::string_view why) { note_client(peer, why); };
  bus_->set_filter(ids);
  last_state_ = bus_->status().state;
  engine.on_set_back.add([this] { on_set_back(); });
  engine.on_tick.add([this] { on_tick(); });
  engine.on_newest.add([this] { on_newest(); });
  for (const Node& node : nodes_)
    send_heartbeat(node, kBootUp);
  next_heartbeat_ = Clock::now() + std::chrono::milliseconds(config_.heartbeat_ms);
  arm_timer();
}

void Endpoint::close() {
  if (closed_) return;
  for (const Node& node : nodes_)
    send_heartbeat(node, kStopped);
  closed_ = true;
  timer_.cancel();
}

Endpoint::Node* Endpoint::find_node(std::uint32_t id) {
  const auto found =
      std::find_if(nodes_.begin(), nodes_.end(), [id](const Node& node) { return node.id == id; });
  return found == nodes_.end() ? nullptr : &*found;
}

void Endpoint::on_frame(const Frame& frame, std::int64_t stamp_ns) {
  if (measure_latency_ && stamp_ns > 0) {
    measure_latency_ = false;  // once per timer: reading the time is a system call on some machines
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    latency_ns_ = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count() - stamp_ns;
    worst_latency_ns_ = std::max(worst_latency_ns_, latency_ns_);
  }
  const Match found = match(config_.profile, frame);
  if (!found.ok()) {
    ++problems_[static_cast<std::size_t>(found.problem)];
    return;
  }
  Node* const node = find_node(found.node);
  if (node != nullptr && !is_for(*node, *found.row)) return;
  if (from_bench(found)) {
    if (!found.row->per_node || node != nullptr) note_conflict(frame, node);
    return;
  }
  if (node == nullptr) return;
  if (node->conflict.is_silent() && node->seat.owner() == 0) return;  // no answer could be sent
  const Values values = decode(*found.row, config_.profile, frame);
  switch (found.row->message) {
    case Message::kCommand:
      return on_command(*node, *found.row, values);
    case Message::kPhaseCommand:
      return on_phase_command(*node, *found.row, values);
    case Message::kRequest:
      return on_request(*node, values);
    default:
      return on_heartbeat(*node, values);
  }
}

void Endpoint::log_refusal(const Node& node, std::string_view what, std::string_view why) {
  if (!refusal_log_.allow()) return;
  log::warn("{}: {} for axis {} was refused: {} ({} more before)", bus_->name(), what, node.axis, why,
            refusal_log_.held_back());
}

void Endpoint::on_request(Node& node, const Values& values) {
  constexpr auto field = [](std::string_view name) { return index_of(Message::kRequest, true, name); };
  const std::uint64_t code = unsigned_of(values[field("request")]);
  const std::uint64_t lease = unsigned_of(values[field("lease")]);
  const auto controller = static_cast<std::uint32_t>(unsigned_of(values[field("controller")]));
  const auto request = static_cast<Request>(code);
  if (code == 0 || code > static_cast<std::uint64_t>(Request::kClearFaults)) {
    return turn_away(node, request, controller, Refused::kMalformed, "its code must be 1 to 4");
  }
  if (engine_->takes_voltages(node.axis)) {
    return turn_away(node, request, controller, Refused::kSharedAmplifier,
                     engine_->sentence_of(Refused::kSharedAmplifier, node.axis));
  }
  if (request == Request::kAcquire) return acquire(node, controller);
  if (node.seat.owner() == 0 || lease != node.lease) {
    return turn_away(node, request, controller, Refused::kNotOwner);
  }
  node.seat.hear(Clock::now());
  act(node, request, controller);
}

Client Endpoint::client_of(std::uint32_t controller) const {
  return {
      .transport = "can", .peer = bus_->name() + " controller " + std::to_string(controller), .subject = {}};
}

void Endpoint::turn_away(const Node& node, Request request, std::uint32_t controller, Refused refused,
                         std::string_view why) {
  if (why.empty()) why = sentence_of(refused);
  ++refused_;
  const bool acquires = request == Request::kAcquire;
  log_refusal(node, acquires ? "the lease" : "a request", why);
  if (audit_ != nullptr) {
    const Client client = client_of(controller);
    Audit::Event event{
        .name = acquires ? "acquire" : "forbidden", .axis = node.axis, .client = &client, .result = why};
    if (!acquires) event.details = {{"request", static_cast<std::uint64_t>(request)}};
    audit_->note(std::move(event));
  }
  reply(node, request, refused, controller, 0, 0);
}

void Endpoint::note_client(const std::string& peer, std::string_view why) {
  ++turned_away_;
  if (audit_ == nullptr) return;
  const Client client{.transport = "can", .peer = bus_->name() + " " + peer, .subject = {}};
  audit_->note({.name = "limit", .client = &client, .result = why});
}

void Endpoint::acquire(Node& node, std::uint32_t controller) {
  notice_end(node);  // in lockstep no tick may have run since the lease ended
  const bool known = node.controller == controller && (node.seat.owner() != 0 || node.seat.is_acquiring());
  if (engine_->config().mode == RunMode::kFree) {
    return turn_away(node, Request::kAcquire, controller, Refused::kWrongMode);
  }
  if (node.seat.is_acquiring() && !known) {
    return turn_away(node, Request::kAcquire, controller, Refused::kBusy, "another controller asks for it");
  }
  if (node.seat.is_acquiring()) return;  // the same controller asks again before the answer
  if (node.seat.owner() != 0 && !known) {
    return turn_away(node, Request::kAcquire, controller, Refused::kOwned);
  }
  node.controller = controller;
  const Client client = client_of(controller);
  node.seat.ask(
      LeaseAction::kAcquire, node.seat.number_for(client),
      [this, &node, controller](Refused refused, Tick tick) { on_acquired(node, controller, refused, tick); },
      &client);
}

void Endpoint::on_acquired(Node& node, std::uint32_t controller, Refused refused, Tick tick) {
  if (refused != Refused::kNot) {
    ++refused_;
    log_refusal(node, "the lease", sentence_of(refused));
    return reply(node, Request::kAcquire, refused, controller, 0, tick);
  }
  const bool is_new = node.lease == 0;
  if (is_new && node.conflict.is_silent()) {  // since the request
    return lose(node, "another bench has its identifiers");
  }
  if (is_new) {
    node.lease = node.last_lease = static_cast<std::uint8_t>(node.last_lease % 255 + 1);
    node.commanded_at = -1;
  }
  node.phases = {};
  node.monitored = false;
  node.seat.hear(Clock::now());
  reply(node, Request::kAcquire, refused, controller, node.lease, tick);
  // The controller needs these frames to begin; in lockstep no tick would send them.
  const Sample& newest = engine_->newest(node.axis);
  send_state(node, newest);
  send_sensors(node, newest);
  if (lockstep()) send_sync(newest.tick);
}

void Endpoint::act(Node& node, Request request, std::uint32_t controller) {
  Engine::Answer answer = [this, &node, request, controller](Refused refused, Tick tick) {
    const std::uint8_t lease = node.lease;
    if (request == Request::kRelease && refused == Refused::kNot) node.lease = 0;
    if (refused != Refused::kNot) ++refused_;
    reply(node, request, refused, controller, lease, tick);
    send_state(node, engine_->newest(node.axis));
  };
  const Owner owner = node.seat.owner();
  if (request == Request::kRenew) return node.seat.ask(LeaseAction::kRenew, owner, std::move(answer));
  if (request == Request::kRelease) return node.seat.ask(LeaseAction::kRelease, owner, std::move(answer));
  engine_->request({.tick = 0, .axis = node.axis, .owner = owner, .action = ClearFaults{}},
                   std::move(answer));
}

void Endpoint::on_heartbeat(Node& node, const Values& values) {
  node.seat.hear(Clock::now());
  if (node.seat.owner() == 0) return;
  const double state = values[index_of(Message::kControllerHeartbeat, true, "state")];
  if (state == kBootUp && node.monitored) return lose(node, "its controller has started anew");
  if (state == kStopped) return lose(node, "its controller says that it has stopped");
  node.monitored = true;
}

void Endpoint::lose(Node& node, const char* why) {
  log_loss(node, why);
  node.lease = 0;
  node.seat.lose();
}

void Endpoint::log_loss(const Node& node, std::string_view why) {
  if (!loss_log_.allow()) return;
  log::warn("{}: axis {} loses its controller: {} ({} more before)", bus_->name(), node.axis, why,
            loss_log_.held_back());
}

void Endpoint::on_state() {
  const BusState state = bus_->status().state;
  if (state == last_state_) return;
  if (state_log_.allow()) {
    log::warn("{}: {}, was {} ({} more changes before)", bus_->name(), name_of(state), name_of(last_state_),
              state_log_.held_back());
  }
  const bool appeared = last_state_ == BusState::kAbsent;
  last_state_ = state;
  if (!appeared) return;
  for (const Node& node : nodes_)
    send_heartbeat(node, kBootUp);
}

void Endpoint::arm_timer() {
  timer_.expires_after(kTimerPeriod);
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || closed_) return;
    on_timer();
    arm_timer();
  });
}

void Endpoint::on_timer() {
  const Clock::time_point now = Clock::now();
  look_at_conflicts(now);
  measure_latency_ = true;
  // All nodes before look_after(): if an axis loses its lease there, the next tick may begin for the others.
  const Tick tick = engine_->tick();
  for (Node& node : nodes_) {
    notice_end(node);
    if (std::exchange(node.spoke, false)) node.seat.hear(now);
    const bool waits = node.commanded_at == tick;
    if (std::exchange(node.waits, waits) || waits) node.seat.wait(now);
  }
  for (Node& node : nodes_)
    look_after(node, now);
  if (config_.heartbeat_ms == 0 || now < next_heartbeat_) return;
  next_heartbeat_ = std::max(next_heartbeat_ + std::chrono::milliseconds(config_.heartbeat_ms), now);
  for (const Node& node : nodes_)
    send_heartbeat(node, kOperational);
}

/// Takes the lease from a controller that has gone. In lockstep a controller that has commanded the present
/// tick may be silent: it waits for the other axes.
void Endpoint::look_after(Node& node, Clock::time_point now) {
  if (node.seat.owner() == 0) return;
  const std::chrono::milliseconds heartbeat_limit(config_.controller_timeout_ms);
  const std::chrono::milliseconds idle_limit(config_.idle_timeout_ms);
  if (node.monitored && node.seat.is_unheard(now, heartbeat_limit)) {
    ++heartbeats_lost_;
    lose(node, "its heartbeat stays away");
  } else if (lockstep() && idle_limit.count() > 0 && node.seat.is_silent(now, idle_limit)) {
    lose(node, "it has been silent for too long");
  }
}

TransportReport Endpoint::report() const {
  const BusStatus& status = bus_->status();
  TransportReport report{.name = "can " + bus_->name(),
                         .state = has_conflict() ? "ID_CONFLICT" : std::string(name_of(status.state)),
                         .counts = {{"sent", status.sent},
                                    {"confirmed", status.confirmed},
                                    {"received", status.received},
                                    {"send_dropped", status.send_dropped},
                                    {"receive_dropped", status.receive_dropped},
                                    {"error_frames", status.error_frames},
                                    {"malformed", status.malformed},
                                    {"commands", commands_},
                                    {"refused", refused_},
                                    {"not_owner", not_owner_},
                                    {"turned_away", turned_away_},
                                    {"conflicts", conflicts_},
                                    {"heartbeats_lost", heartbeats_lost_},
                                    {"receive_latency_ns", not_negative(latency_ns_)},
                                    {"worst_receive_latency_ns", not_negative(worst_latency_ns_)}}};
  for (std::size_t i = 1; i < problems_.size(); ++i)
    report.counts.emplace_back(can::name_of(static_cast<FrameProblem>(i)), problems_[i]);
  return report;
}

}  // namespace drivebench::can
