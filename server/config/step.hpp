#pragma once

#include <span>

#include "server/config/axis.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// The number of substeps that suits every axis by itself, for benches that do not name one.
int automatic_substeps(std::span<const AxisReading> axes, std::int64_t period_ns);

/// Tells if the integration step is too long for an axis.
void check_step(StrictTable& bench, const BenchSetup& setup, const AxisReading& axis);

}  // namespace drivebench
