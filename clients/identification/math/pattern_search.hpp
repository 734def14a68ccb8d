#pragma once

#include <functional>
#include <span>
#include <vector>

namespace drivebench::identification {

/// A positive quantity that a search changes by factors.
struct SearchVariable {
  double start = 1.0;
  double least = 0.0;
  double most = 0.0;
};

struct PatternSearch {
  double first_factor = 2.0;
  double last_factor = 1.15;  ///< the search ends when no smaller change than this one helps
  int most_trials = 60;
};

/// What is to become small; it need not be smooth, nor finite everywhere.
using Score = std::function<double(const std::vector<double>&)>;

/// The best point that was tried: each variable in turn becomes a factor larger or smaller, in the direction
/// that helped last time first, and the factor shrinks to its square root when none helps. A point is tried
/// once, rounded to three significant digits, within its bounds. Deterministic. Method: coordinate search
/// after Hooke and Jeeves.
std::vector<double> pattern_search(std::span<const SearchVariable> variables, const PatternSearch& search,
                                   const Score& score);

}  // namespace drivebench::identification
