#pragma once

#include <cstdint>

namespace drivebench {

/// Index of a sample period; tick k starts at t = kT.
using Tick = std::int64_t;

}  // namespace drivebench
