#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/config/config.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// Reads [[axis.load]], [[axis.set]], [[axis.fault]] and [[axis.bump]]. `p` are the parameters at the start,
/// or null if they are not known: then [[axis.set]] is only looked at for its keys.
std::vector<AxisEvent> read_events(StrictTable& axis, const AxisParameters* p, bool shares_shaft,
                                   std::int64_t period_ns);

/// The same as TOML, in ticks.
std::string events_text(const std::vector<AxisEvent>& events, const AxisParameters& p);

}  // namespace drivebench
