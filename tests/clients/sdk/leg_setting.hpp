#pragma once

#include <drivebench_bridge.h>

#include <cstdint>

namespace drivebench {

/// The setting of a leg; its first period starts at 0.
inline drivebench_leg leg_at(std::uint32_t mode, std::uint64_t period_ps = 0, std::uint64_t compare_ps = 0,
                             std::uint64_t dead_ps = 0, std::uint32_t centred = 0) {
  return {.mode = mode,
          .centred = centred,
          .period_start_ps = 0,
          .period_ps = period_ps,
          .compare_ps = compare_ps,
          .dead_ps = dead_ps};
}

}  // namespace drivebench
