#pragma once

#include <span>

#include "server/config/sections/axis.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// The smallest number of substeps that suits every axis, for benches that do not set one.
int automatic_substeps(std::span<const AxisReading> axes, std::int64_t period_ns);

/// Reports an integration step that is too long for the axis.
void check_step(StrictTable& bench, const BenchSetup& setup, const AxisReading& axis);

}  // namespace drivebench
