#pragma once

#include <string>
#include <vector>

#include "server/config/config.hpp"
#include "server/config/sections/event_time.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// The parts of an axis that are those of another one.
struct SharedParts {
  bool shaft = false;
  bool drive = false;
};

/// Reads [[axis.load]], [[axis.set]], [[axis.fault]], [[axis.bump]] and [[axis.multisine]]. `p` are the
/// initial parameters, or null if they are wrong: then only the keys of [[axis.set]] are checked.
std::vector<AxisEvent> read_events(StrictTable& axis, const AxisParameters* p, SharedParts shared,
                                   const EventPlace& place);

/// The events of an axis as TOML, in ticks.
std::string events_text(const std::vector<AxisEvent>& events, const AxisParameters& p,
                        const EventPlace& place);

/// An event in words, for example "fault open_phase = 2 when speed_rad_s > 100 for 40 ticks".
std::string event_text(const AxisEvent& event, const AxisParameters& p, const EventPlace& place);

}  // namespace drivebench
