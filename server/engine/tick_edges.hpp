#pragma once

#include <array>
#include <cstdint>

#include "server/bench/bench.hpp"

namespace drivebench {

/// The edges of the encoder lines A and B within a tick, for a device that plays them back.
struct TickEdges {
  static constexpr std::size_t kMost = 128;

  std::int64_t tick = -1;        ///< of the edges
  std::int64_t start_count = 0;  ///< count before the first edge
  std::uint32_t size = 0;        ///< of `edge` in use
  bool incomplete = false;       ///< the tick had more edges
  /// Bits 0..14: time from the start of the tick in units of the period/32768; bit 15: counts down.
  std::array<std::uint16_t, kMost> edge{};
};

/// The edges of the last tick of the bench. Beyond 4096 counts of travel it returns none and sets
/// `incomplete`, to bound the time.
TickEdges edges_of(const Bench& bench, std::size_t axis) noexcept;

}  // namespace drivebench
