#include "protocols/leg_edges.hpp"

#include <algorithm>

namespace drivebench {
namespace {

std::string letter(std::size_t leg) {
  return std::string(1, "abc"[leg]);
}

std::string name(std::size_t leg, std::size_t n) {
  return "edge " + std::to_string(n + 1) + " of leg " + letter(leg);
}

std::string problem_of_leg(const std::array<EdgeRecord, kMaxLegEdges>& list, std::size_t leg,
                           std::int64_t period_ns) {
  const std::int64_t most_ns = std::min<std::int64_t>(period_ns, std::int64_t{kMaxOffsetNs} + 1);
  for (std::size_t n = 0; n < list.size(); ++n) {
    const EdgeRecord& edge = list[n];
    if (edge.level > static_cast<std::uint32_t>(LegLevel::kHigh)) {
      return "the level of " + name(leg, n) + " is " + std::to_string(edge.level) +
             " but must be 1 (off), 2 (low) or 3 (high), or 0 after the last edge";
    }
    if (edge.level == 0) continue;
    if (n > 0 && list[n - 1].level == 0) return name(leg, n) + " follows the end of the list";
    const std::string at = name(leg, n) + " is at " + std::to_string(edge.offset_ns) + " ns but must be ";
    if (edge.offset_ns >= most_ns)
      return at + "before the end of the tick, " + std::to_string(most_ns) + " ns";
    if (n > 0 && edge.offset_ns <= list[n - 1].offset_ns) {
      return at + "after the edge ahead of it, " + std::to_string(list[n - 1].offset_ns) + " ns";
    }
  }
  return {};
}

}  // namespace

EdgeProblem problem_with(const EdgeRecords& edges, std::int64_t period_ns) {
  for (std::size_t leg = 0; leg < edges.size(); ++leg) {
    std::string sentence = problem_of_leg(edges[leg], leg, period_ns);
    if (!sentence.empty()) return {.sentence = std::move(sentence), .field = "commands.edges_" + letter(leg)};
  }
  return {};
}

EdgeProblem too_many_edges(std::size_t leg, std::size_t count) {
  return {.sentence = "leg " + letter(leg) + " has " + std::to_string(count) + " edges but may have " +
                      std::to_string(kMaxLegEdges),
          .field = "commands.edges_" + letter(leg)};
}

/// An offset without a level is nothing, and not to be in hashes.
LegEdges leg_edges(const EdgeRecords& edges) noexcept {
  LegEdges result;
  for (std::size_t leg = 0; leg < edges.size(); ++leg) {
    std::ranges::transform(edges[leg], result[leg].begin(), [](const EdgeRecord& edge) {
      return edge.level != 0 ? LegEdge(edge.offset_ns, static_cast<LegLevel>(edge.level)) : LegEdge();
    });
  }
  return result;
}

EdgeRecords edge_records(const LegEdges& edges) noexcept {
  EdgeRecords result;
  for (std::size_t leg = 0; leg < edges.size(); ++leg) {
    std::ranges::transform(edges[leg], result[leg].begin(), [](LegEdge edge) {
      return EdgeRecord{.offset_ns = edge.offset_ns(), .level = static_cast<std::uint32_t>(edge.level())};
    });
  }
  return result;
}

bool are_in_order(const LegEdges& edges, std::int64_t period_ns) noexcept {
  const auto in_order = [period_ns](const LegEdgeList& list) {
    for (std::size_t n = 0; n < list.size(); ++n) {
      if (list[n].level() == LegLevel::kNone) continue;
      if (list[n].offset_ns() >= period_ns) return false;
      if (n == 0) continue;
      if (list[n - 1].level() == LegLevel::kNone || list[n].offset_ns() <= list[n - 1].offset_ns())
        return false;
    }
    return true;
  };
  return std::ranges::all_of(edges, in_order);
}

}  // namespace drivebench
