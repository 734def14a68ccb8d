#pragma once

#include "protocols/abi/drivebench.h"
#include "protocols/signals/edge_record.hpp"

namespace drivebench::abi {

static_assert(DRIVEBENCH_MAX_EDGES == kMaxLegEdges);
static_assert(DRIVEBENCH_LEVEL_HIGH == static_cast<int>(LegLevel::kHigh));

inline EdgeRecords edges_of(const drivebench_command& command) noexcept {
  EdgeRecords result{};
  for (std::size_t leg = 0; leg < result.size(); ++leg) {
    for (std::size_t n = 0; n < kMaxLegEdges; ++n) {
      const drivebench_edge& edge = command.edges[leg][n];
      result[leg][n] = {.offset_ns = edge.offset_ns, .level = edge.level};
    }
  }
  return result;
}

}  // namespace drivebench::abi
