#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "protocols/signals/command.hpp"
#include "protocols/signals/edge_record.hpp"

/// The edges of a command as they come from outside, and the rules for them: the offsets of a leg rise and
/// are below the period, a level exists, and what follows the end of a list is empty.
namespace drivebench {

/// What is wrong with edges: a sentence with leg, value and rule, and the field. Empty: nothing is.
struct EdgeProblem {
  std::string sentence;
  std::string field;
};
EdgeProblem problem_with(const EdgeRecords& edges, std::int64_t period_ns);
/// More edges than a list holds.
EdgeProblem too_many_edges(std::size_t leg, std::size_t count);

/// Edges that have no problem.
LegEdges leg_edges(const EdgeRecords& edges) noexcept;
EdgeRecords edge_records(const LegEdges& edges) noexcept;

/// The same rules for edges that have been taken: for the tick, without text.
bool are_in_order(const LegEdges& edges, std::int64_t period_ns) noexcept;

}  // namespace drivebench
