// Sends samples, state and answers.
#include <algorithm>

#include "server/endpoints/can/endpoint.hpp"

namespace drivebench::can {

void Endpoint::put(const Node& node, const Frame& frame) {
  if (!node.conflict.is_silent() && !closed_) put(frame);
}

void Endpoint::put(const Frame& frame) {
  if (collecting_) {
    together_.push_back(frame);
  } else {
    bus_->send(frame);
  }
}

std::string Endpoint::send_frame(const Frame& frame) {
  const BusState state = bus_->status().state;
  if (closed_ || state == BusState::kAbsent || state == BusState::kDown)
    return "the bus is " + std::string(name_of(state));
  bus_->send(frame);
  return {};
}

void Endpoint::send(Message message, const Node& node, std::span<const double> values) {
  const MessageRow* const row = find_message(message, config_.profile.fd, node.wide());
  put(node, encode(*row, config_.profile, node.id, values));
}

void Endpoint::send_sample(Message message, const Node& node, const Sample& sample, Page page) {
  const MessageRow* const row = find_message(message, config_.profile.fd, node.wide());
  put(node, encode_sample(*row, config_.profile, node.id, sample, page));
}

/// What was sent or commanded in ticks of another run says nothing about this one.
void Endpoint::on_set_back() {
  for (Node& node : nodes_) {
    node.commanded_at = -1;
    node.index_tick = -1;
    node.edges_tick = -1;
    node.due.reset();
  }
}

void Endpoint::on_tick() {
  for (Node& node : nodes_) {
    notice_end(node);
    const Sample& newest = engine_->newest(node.axis);
    const auto every = static_cast<std::uint64_t>(lockstep() ? 1 : config_.sample_every_ticks);
    if (newest.tick % every == 0) node.due = newest;
    if (config_.edges) send_edges(node);
  }
}

/// Sends the newest sample that is due; if the bench runs ahead of this thread, some are skipped.
void Endpoint::on_newest() {
  std::optional<std::uint64_t> tick;
  collecting_ = true;
  for (Node& node : nodes_) {
    if (!node.due) continue;
    tick = node.due->tick;
    send_changes(node, *node.due);
    if (node.due->tick % static_cast<std::uint64_t>(config_.state_every_ticks) <
        static_cast<std::uint64_t>(lockstep() ? 1 : config_.sample_every_ticks)) {
      send_state(node, *node.due);
    }
    send_sensors(node, *node.due);
    node.due.reset();
  }
  if (tick) send_sync(*tick);
  collecting_ = false;
  bus_->send_together(together_);
  together_.clear();
}

/// The lease may have run out or been taken: by an administrator, or together with all others because this
/// thread stood still or the audit log could not be written. While the lease is being acquired anew the
/// answer decides.
void Endpoint::notice_end(Node& node) {
  if (node.seat.is_acquiring() || !node.seat.notice_end()) return;
  log_loss(node, "its lease has run out or was taken");
  node.lease = 0;
}

void Endpoint::send_sensors(Node& node, const Sample& sample) {
  if (config_.profile.fd) return send_sample(Message::kSensors, node, sample);
  send_sample(Message::kEncoder, node, sample);
  if (node.terminals.speed_sensors) send_sample(Message::kDetails, node, sample, Page::kSpeedSensors);
  if (node.wide()) send_sample(Message::kPhases, node, sample);
  send_sample(Message::kCurrents, node, sample);
}

void Endpoint::send_state(const Node& node, const Sample& sample) {
  send_sample(Message::kState, node, sample);
  if (!config_.profile.fd) send_sample(Message::kCounters, node, sample);
  if (!node.wide()) return;
  send_sample(Message::kDetails, node, sample, Page::kVoltages);
  if (config_.profile.fd) return;
  send_sample(Message::kDetails, node, sample, Page::kField);
  send_sample(Message::kDetails, node, sample, Page::kInjected);
}

void Endpoint::send_changes(Node& node, const Sample& sample) {
  if (sample.faults != node.faults) {
    node.faults = sample.faults;
    send_sample(Message::kFault, node, sample);
  }
  if (sample.index_tick != node.index_tick) {
    node.index_tick = sample.index_tick;
    send_sample(Message::kIndex, node, sample);
  }
  if (node.wide() && sample.injected != node.injected) {
    node.injected = sample.injected;
    send_sample(Message::kDetails, node, sample, Page::kInjected);
  }
}

void Endpoint::send_edges(Node& node) {
  const TickEdges& edges = engine_->edges(node.axis);
  if (edges.tick == node.edges_tick) return;
  node.edges_tick = edges.tick;
  const MessageRow& row = *find_message(Message::kEdges, true);
  std::int64_t count = edges.start_count;
  for (std::uint32_t sent = 0; sent < edges.size || (sent == 0 && edges.incomplete);) {
    const std::uint32_t size = std::min<std::uint32_t>(edges.size - sent, kEdgesPerFrame);
    const std::uint32_t following = edges.size - sent - size;
    Frame frame = encode(row, config_.profile, node.id,
                         std::array{static_cast<double>(edges.tick), static_cast<double>(count),
                                    static_cast<double>(size), edges.incomplete ? 255.0 : following});
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint16_t packed = edges.edge[sent + i];
      const bool down = (packed & 0x8000u) != 0;
      put_edge(frame, i, {.time = static_cast<std::uint16_t>(packed & 0x7FFFu), .down = down});
      count += down ? -1 : 1;
    }
    put(node, frame);
    sent += size;
    if (size == 0) break;
  }
}

void Endpoint::send_sync(std::uint64_t tick) {
  const bool has_samples =  // SYNC says that they are out
      std::ranges::any_of(nodes_, [](const Node& node) { return !node.conflict.is_silent(); });
  if (!has_samples || sync_conflict_.is_silent() || closed_) return;
  const MessageRow& row = *find_message(Message::kSync, config_.profile.fd);
  put(encode(row, config_.profile, 0, std::array{static_cast<double>(tick), lockstep() ? 1.0 : 0.0}));
}

void Endpoint::send_heartbeat(const Node& node, double state) {
  const double period_us = static_cast<double>(engine_->config().setup.period_ns) * 1e-3;
  send(Message::kHeartbeat, node,
       std::array{state, static_cast<double>(version_of(config_.profile.id_set, node.wide())),
                  static_cast<double>(engine_->newest(node.axis).state), static_cast<double>(node.lease),
                  period_us});
}

void Endpoint::reply(const Node& node, Request request, Refused refused, std::uint32_t controller,
                     std::uint8_t lease, std::int64_t tick) {
  if (lacks_lease(refused)) ++not_owner_;
  send(Message::kReply, node,
       std::array{static_cast<double>(request), static_cast<double>(refusal_row(refused).can),
                  static_cast<double>(controller), static_cast<double>(lease), static_cast<double>(tick)});
}

}  // namespace drivebench::can
