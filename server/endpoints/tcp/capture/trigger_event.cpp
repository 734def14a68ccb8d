#include "server/endpoints/tcp/capture/trigger_event.hpp"

#include <utility>

namespace drivebench {

bool EventDetector::see(const Sample& sample) noexcept {
  const bool had_previous = std::exchange(has_previous_, true);
  if (has_bits()) {
    const std::uint64_t now = sample.*event_.signal->as_unsigned;
    const std::uint64_t before = std::exchange(word_, now);
    return had_previous && (now & ~before & event_.bits) != 0;
  }
  const double now = value_of(*event_.signal, sample);
  const double before = std::exchange(value_, now);
  if (event_.kind == TriggerEventKind::kAbove) return now > event_.level;
  if (event_.kind == TriggerEventKind::kBelow) return now < event_.level;
  return had_previous && is_event(before, now);
}

bool EventDetector::is_event(double before, double now) const noexcept {
  switch (event_.kind) {
    case TriggerEventKind::kRising:
      return before < event_.level && now >= event_.level;
    case TriggerEventKind::kFalling:
      return before > event_.level && now <= event_.level;
    case TriggerEventKind::kLeaves:
      return is_inside(before) && is_outside(now);
    case TriggerEventKind::kEnters:
      return is_outside(before) && is_inside(now);
    case TriggerEventKind::kEquals:
      return before != event_.level && now == event_.level;
    default:  // see() has judged it
      return false;
  }
}

}  // namespace drivebench
