#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <string>
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

/// The candidate that an unknown name most likely means: the first that contains it, or else the first with
/// the smallest edit distance, if that is at most 2 letters or a third of the name and a letter stays. Empty
/// if there is none,
/// or if the name is longer than 64 bytes, which bounds the time that a hostile file takes. `name_of` gives
/// the name of a candidate, which must outlive the call.
template <class Range, class NameOf = std::identity>
std::string_view nearest_name(std::string_view name, const Range& candidates, NameOf name_of = {}) {
  constexpr std::size_t kLongest = 64;
  if (name.empty() || name.size() > kLongest) return {};
  std::string_view nearest;
  std::size_t fewest = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const auto& candidate : candidates) {
    const std::string_view known = std::invoke(name_of, candidate);
    const std::size_t distance = known.find(name) != std::string_view::npos ? 0 : edit_distance(name, known);
    if (distance < fewest && distance < std::max(name.size(), known.size())) {
      nearest = known;
      fewest = distance;
    }
  }
  return nearest;
}

/// The end of a sentence that refuses an unknown name: `; did you mean "name"?`, or nothing if no candidate
/// is near.
template <class Range, class NameOf = std::identity>
std::string did_you_mean(std::string_view name, const Range& candidates, NameOf name_of = {}) {
  const std::string_view nearest = nearest_name(name, candidates, name_of);
  return nearest.empty() ? std::string() : "; did you mean \"" + std::string(nearest) + "\"?";
}

/// As did_you_mean(), but lists all candidates if none is near: `; known here: a, b`.
template <class Range, class NameOf = std::identity>
std::string advice(std::string_view name, const Range& candidates, NameOf name_of = {}) {
  std::string text = did_you_mean(name, candidates, name_of);
  if (!text.empty()) return text;
  for (const auto& candidate : candidates)
    text.append(text.empty() ? "; known here: " : ", ").append(std::invoke(name_of, candidate));
  return text;
}

}  // namespace drivebench
