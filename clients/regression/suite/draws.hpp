#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "clients/regression/suite/variation.hpp"

namespace drivebench::regression {

/// The most cases that a matrix and its draws may make of one file.
inline constexpr std::size_t kMostCombinations = 1'000'000;

/// The largest seed: every number up to it is exact in a double.
inline constexpr std::int64_t kMostSeed = std::int64_t{1} << 53;

/// Values drawn at random: all variations have `count` values, which belong together.
struct Draws {
  std::size_t count = 1;
  std::vector<Variation> variations{};
};

/// Reads `[draw]` of a case; without one there is a single draw of nothing. A value depends on the seed, its
/// path and its number alone, on every machine alike: more draws, or draws of other keys, leave it as it is.
/// It has six significant digits, so that the name of a case tells the value exactly. Problems go to the
/// list.
Draws read_draws(const ConfigNode& root, const std::string& file, ProblemList& problems);

}  // namespace drivebench::regression
