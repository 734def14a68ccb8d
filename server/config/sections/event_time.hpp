#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "server/config/config.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// Where an event stands: its axis among all axes of the bench, and the length of a tick.
struct EventPlace {
  std::size_t axis = 0;
  std::span<const std::string> names;  ///< of all axes; empty for one without a valid name
  std::int64_t period_ns = 0;
};

/// When an event happens: in a tick, or some ticks after its trigger.
struct EventTime {
  Tick tick = 0;
  std::optional<Trigger> trigger{};
};

/// Reads at_s or at_tick; or when, for_s or for_ticks, and delay_s or delay_ticks.
EventTime read_event_time(StrictTable& table, const EventPlace& place);

/// Reads the end of a fault that begins at `begin`: until_s or until_tick, or behind a trigger lasts_s or
/// lasts_ticks.
std::optional<EventTime> read_event_end(StrictTable& table, const EventTime& begin, std::int64_t period_ns);

}  // namespace drivebench
