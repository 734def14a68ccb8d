#pragma once

#include <array>
#include <cstdint>

#include "protocols/signals/command.hpp"

namespace drivebench {

/// An edge of a leg before anything has looked at it. The layout is that of drivebench_edge.
struct EdgeRecord {
  std::uint32_t offset_ns = 0;
  std::uint32_t level = 0;  ///< a LegLevel; 0 ends the list
};
using EdgeRecords = std::array<std::array<EdgeRecord, kMaxLegEdges>, 3>;

}  // namespace drivebench
