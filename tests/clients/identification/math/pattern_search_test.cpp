// The search of an experiment by factors.
#include "clients/identification/math/pattern_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace drivebench::identification::pattern_search_test {
namespace {

double square(double x) {
  return x * x;
}

// Catches: a search that ends before its smallest factor helps no more, or one direction that is never tried.
TEST(PatternSearch, FindsTheLeastWithinItsSmallestFactor) {
  const std::array<SearchVariable, 2> variables = {
      {{.start = 1.0, .least = 1e-3, .most = 1e3}, {.start = 1.0, .least = 1e-3, .most = 1e3}}};
  const PatternSearch search{.first_factor = 2.0, .last_factor = 1.05, .most_trials = 1000};
  const std::vector<double> best = pattern_search(variables, search, [](const std::vector<double>& x) {
    return square(std::log(x[0] / 37.0)) + square(std::log(x[1] * 23.0));
  });
  EXPECT_NEAR(std::log(best[0] / 37.0), 0.0, std::log(1.05));
  EXPECT_NEAR(std::log(best[1] * 23.0), 0.0, std::log(1.05));
}

// Catches: a point outside its bounds, one tried twice, one with digits that a file would not show, more
// trials than allowed.
TEST(PatternSearch, TriesRoundedPointsWithinBoundsOnceAndNoMoreThanAllowed) {
  const std::array<SearchVariable, 3> variables = {{{.start = 3.33333, .least = 0.5, .most = 4.0},
                                                    {.start = 0.1, .least = 0.0123, .most = 0.3},
                                                    {.start = 1e6, .least = 5e5, .most = 1.234e6}}};
  std::set<std::vector<double>> tried;
  const PatternSearch search{.first_factor = 2.0, .last_factor = 1.01, .most_trials = 50};
  pattern_search(variables, search, [&](const std::vector<double>& x) {
    for (std::size_t k = 0; k < x.size(); ++k) {
      EXPECT_GE(x[k], variables[k].least);
      EXPECT_LE(x[k], variables[k].most);
      const double digits = x[k] / std::pow(10.0, std::floor(std::log10(x[k])) - 2.0);
      EXPECT_TRUE(std::abs(digits - std::round(digits)) < 1e-9 || x[k] == variables[k].most ||
                  x[k] == variables[k].least)
          << x[k];
    }
    EXPECT_TRUE(tried.insert(x).second);
    return -x[0] * x[1] + 1e-7 * x[2];
  });
  EXPECT_LE(tried.size(), 50u);
  EXPECT_GT(tried.size(), 10u);
}

// Catches: a search that stays where a score only says how far away the candidates are.
TEST(PatternSearch, ComesBackFromBeyondALimit) {
  const std::array<SearchVariable, 2> variables = {
      {{.start = 8.0, .least = 0.1, .most = 10.0}, {.start = 8.0, .least = 0.1, .most = 10.0}}};
  const auto score = [](const std::vector<double>& x) {
    if (x[0] + x[1] > 5.0) return 1e6 * (x[0] + x[1]);     // beyond a limit
    return x[0] * x[1] > 4.0 ? 1.0 / (x[0] * x[1]) : 1e3;  // unused
  };
  const std::vector<double> best = pattern_search(variables, {.most_trials = 200}, score);
  EXPECT_LE(best[0] + best[1], 5.0);
  EXPECT_GT(best[0] * best[1], 4.0);
}

}  // namespace
}  // namespace drivebench::identification::pattern_search_test
