#include "clients/identification/math/pattern_search.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <map>
#include <string>
#include <utility>

namespace drivebench::identification {
namespace {

/// With three significant digits, as people write an amplitude.
double rounded(double value) {
  return std::strtod(fmt::format("{:.3g}", value).c_str(), nullptr);
}

/// Scores of points, each worked out once.
class Trials {
 public:
  Trials(const Score& score, int most) : score_(score), left_(most) {}

  bool is_over() const noexcept { return left_ <= 0; }
  /// Infinite when no trial is left.
  double at(const std::vector<double>& point) {
    const auto known = known_.find(point);
    if (known != known_.end()) return known->second;
    if (is_over()) return std::numeric_limits<double>::infinity();
    --left_;
    return known_.emplace(point, score_(point)).first->second;
  }

 private:
  const Score& score_;
  int left_;
  std::map<std::vector<double>, double> known_;
};

}  // namespace

std::vector<double> pattern_search(std::span<const SearchVariable> variables, const PatternSearch& search,
                                   const Score& score) {
  std::vector<double> best;
  best.reserve(variables.size());
  for (const SearchVariable& v : variables)
    best.push_back(std::clamp(rounded(v.start), v.least, v.most));
  std::vector<bool> upwards(variables.size(), true);
  Trials trials(score, search.most_trials);
  double least = trials.at(best);
  double factor = search.first_factor;
  while (factor >= search.last_factor && !trials.is_over()) {
    bool helped = false;
    for (std::size_t k = 0; k < variables.size(); ++k) {
      for (int turn = 0; turn < 2; ++turn) {
        std::vector<double> there = best;
        there[k] = std::clamp(rounded(upwards[k] ? best[k] * factor : best[k] / factor), variables[k].least,
                              variables[k].most);
        const double value = trials.at(there);
        if (value < least) {
          least = value;
          best = std::move(there);
          helped = true;
          break;
        }
        upwards[k] = !upwards[k];
      }
    }
    if (!helped) factor = std::sqrt(factor);
  }
  return best;
}

}  // namespace drivebench::identification
