// Notices frames from elsewhere that have identifiers of this bench.
#include <fmt/core.h>

#include <algorithm>

#include "server/endpoints/can/endpoint.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench::can {

/// `node`: the one whose identifier the frame has; null: SYNC, which belongs to all.
void Endpoint::note_conflict(const Frame& frame, Node* node) {
  ++conflicts_;
  const Clock::time_point now = Clock::now();
  for (Node& each : nodes_) {
    if (node == nullptr || node == &each) fall_silent(each, now);
  }
  if (node == nullptr) sync_conflict_.note(now);
  if (!conflict_log_.allow()) return;
  const Conflict& conflict = node == nullptr ? sync_conflict_ : node->conflict;
  log::error(
      "{}: ID_CONFLICT: a frame with identifier {:#x} of this bench came from elsewhere; {} silent for "
      "{} s ({} more before)",
      bus_->name(), frame.id, node == nullptr ? "all axes are" : fmt::format("axis {} is", node->axis),
      std::chrono::duration_cast<std::chrono::seconds>(conflict.pause()).count(), conflict_log_.held_back());
}

/// The first frame may be a stray one: the controller keeps its lease, and its watchdog goes on. A second one
/// is another bench, whose frames the controller may take for those of this one.
void Endpoint::fall_silent(Node& node, Clock::time_point now) {
  if (node.conflict.is_silent()) return;
  const bool again = node.conflict.lasts();
  if (again && node.seat.owner() != 0) lose(node, "another bench has its identifiers");
  send_heartbeat(node, again ? kStopped : kOperational);  // so that another bench notices as well
  node.conflict.note(now);
}

void Endpoint::look_at_conflicts(Clock::time_point now) {
  sync_conflict_.look(now);
  for (Node& node : nodes_) {
    if (!node.conflict.look(now) || !lockstep()) continue;
    // Time stands still, and the controller waits for frames that were not sent.
    node.due = engine_->newest(node.axis);
    on_newest();
  }
}

bool Endpoint::has_conflict() const {
  return sync_conflict_.lasts() ||
         std::ranges::any_of(nodes_, [](const Node& node) { return node.conflict.lasts(); });
}

}  // namespace drivebench::can
