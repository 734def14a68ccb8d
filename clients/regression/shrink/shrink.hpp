#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

#include "protocols/document.hpp"

namespace drivebench::regression {

/// What a failing case is made smaller with.
struct ShrinkPlan {
  std::size_t check;                  ///< the number of the check that fails, of those in the table
  std::optional<double> longest_s{};  ///< a run of this length fails; empty: the length must stay
  std::size_t most_runs = 200;
  std::function<bool()> is_stopped = [] { return false; };  ///< ends the search before the next run
};

/// Whether a case fails as the first one did. A table that is no case does not.
using StillFails = std::function<bool(const ConfigNode& table)>;
/// Hears of each part that has become smaller.
using TellStep = std::function<void(const std::string& what, std::size_t runs)>;

struct Shrunk {
  ConfigNode table;  ///< fails still
  std::size_t runs = 0;
  bool is_smallest = false;  ///< no single change that was tried makes it smaller; false: it ended before
};

/// Makes a failing case smaller by delta debugging: fewer checks, steps, overrides and gains, a shorter run,
/// rounder numbers, until no change keeps it failing, the runs are used up or the search is stopped. The same
/// case gives the same result.
Shrunk shrink(const ConfigNode& table, const ShrinkPlan& plan, const StillFails& still_fails,
              const TellStep& tell);

/// The number of numbers, words and switches in a part of a case.
std::size_t leaf_count(const ConfigNode& node);

}  // namespace drivebench::regression
