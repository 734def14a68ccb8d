#pragma once

#include "clients/link/common/axis_link.hpp"

namespace drivebench::command {

/// Arms an axis and brings it to rest after an earlier run, as reference::Rest has it; in lockstep the rotor
/// flux of a servo motor would otherwise stay. Does nothing at tick 0 of a bench whose first command arms.
/// Throws UsageError if it still turns after 5 s.
void let_rest(link::AxisLink& bench, double counts_per_revolution);

}  // namespace drivebench::command
