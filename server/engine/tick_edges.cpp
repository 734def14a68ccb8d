#include "server/engine/tick_edges.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace drivebench {
namespace {

constexpr double kMaxTravelCounts = 4096.0;

std::uint16_t packed(const Edge& edge, double period_s) noexcept {
  const double part = std::clamp(edge.time_s / period_s, 0.0, 1.0);
  const auto time = static_cast<std::uint16_t>(std::min(32767.0, std::floor(part * 32768.0)));
  return static_cast<std::uint16_t>(time | (edge.direction < 0 ? 0x8000u : 0u));
}

}  // namespace

TickEdges edges_of(const Bench& bench, std::size_t index) noexcept {
  const Axis& axis = bench.axis(index);
  const double period_s = axis.timing().period_s;
  const int counts_per_revolution = axis.parameters().encoder.counts_per_revolution;
  TickEdges result;
  result.tick = bench.tick() - 1;
  const EncoderState& start = axis.last_tick_encoder();
  result.start_count = start.count;
  double travel_rad = 0.0;
  for (const AngleSegment& segment : axis.last_tick())
    travel_rad += std::abs(segment.end_rad - segment.start_rad);
  // The begin or end of a fault can make the count jump without travel.
  const std::int64_t jump = std::abs(axis.state().encoder.count - start.count);
  if (!(travel_rad * counts_per_revolution / (2.0 * std::numbers::pi) < kMaxTravelCounts) ||
      jump >= static_cast<std::int64_t>(kMaxTravelCounts)) {
    result.incomplete = true;
    return result;
  }
  axis.encoder().for_each_edge(axis.last_tick(), axis.last_tick_turn(), start, axis.injected(),
                               [&](const Edge& edge) {
                                 if (result.size == TickEdges::kMost) {
                                   result.incomplete = true;
                                   return;
                                 }
                                 result.edge[result.size++] = packed(edge, period_s);
                               });
  return result;
}

}  // namespace drivebench
