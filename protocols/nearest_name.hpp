#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <string_view>
#include <vector>

namespace drivebench {

/// The Levenshtein distance: the fewest letters to insert, drop or change.
inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
    row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U);
      diagonal = row[j];
      row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

/// The name with the smallest edit distance, for "did you mean"; a name that begins with the wrong one has
/// distance 0. Empty if there are no candidates. `name_of` gives the name of a candidate, which must outlive
/// the call.
template <class Range, class NameOf>
std::string_view nearest_name(std::string_view name, const Range& candidates, NameOf name_of) {
  std::string_view nearest;
  std::size_t fewest = 0;
  bool first = true;
  for (const auto& candidate : candidates) {
    const std::string_view there = std::invoke(name_of, candidate);
    const std::size_t distance = there.starts_with(name) ? 0 : edit_distance(name, there);
    if (first || distance < fewest) {
      nearest = there;
      fewest = distance;
      first = false;
    }
  }
  return nearest;
}

}  // namespace drivebench
