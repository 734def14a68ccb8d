#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace drivebench::speed {

enum class Change {
  kSame,
  kSlower,  ///< or larger: worse
  kFaster,
  kNotComparable,  ///< on one side alone, skipped, disturbed, or without a floor on two machines
};

/// One figure of two runs.
struct Compared {
  std::string name;
  std::string before;  ///< ratio to the floor, or the figure with its unit
  std::string after;
  double change = 0.0;  ///< +0.1: a tenth worse
  Change verdict = Change::kNotComparable;
  std::string reason{};  ///< why it is not comparable
};

/// Compares the `--json` objects of two runs. Where both have a floor their ratios are compared, since the
/// machine may be faster on one of the days. Worse or better is what lies outside the other run's range
/// (`--times`) by more than 5 %. Throws std::runtime_error for an object that is not one of `--json`.
std::vector<Compared> compare(const nlohmann::json& before, const nlohmann::json& after);

void print_comparison(const std::vector<Compared>& rows);

}  // namespace drivebench::speed
