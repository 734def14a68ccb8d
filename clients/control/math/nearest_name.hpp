#pragma once

#include <cstddef>
#include <functional>
#include <string_view>

namespace drivebench::control {

/// Levenshtein: the fewest letters to insert, drop or change.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The name with the fewest letters to change, for "did you mean", where one that only goes on after the last
/// letter counts as equal; empty if there are none. `name_of` gives the name of an element, which must
/// outlive the call.
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

}  // namespace drivebench::control
