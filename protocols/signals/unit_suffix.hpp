#pragma once

#include <algorithm>
#include <array>
#include <string_view>

namespace drivebench {

/// A name that ends with its unit, as all real signals and the telemetry of controllers do.
struct NameWithUnit {
  std::string_view name;  ///< without the unit
  std::string_view unit;  ///< empty: the name has none
};

/// `speed_rad_s` is speed in rad/s.
constexpr NameWithUnit split_unit(std::string_view name) noexcept {
  // Of two suffixes that fit the longer one comes first.
  constexpr auto kSuffixes = std::to_array<NameWithUnit>({{"_rad_s2", "rad/s^2"},
                                                          {"_rad_s", "rad/s"},
                                                          {"_rad", "rad"},
                                                          {"_wb", "Wb"},
                                                          {"_nm", "N*m"},
                                                          {"_a", "A"},
                                                          {"_v", "V"},
                                                          {"_w", "W"},
                                                          {"_k", "K"},
                                                          {"_s", "s"}});
  const auto row = std::ranges::find_if(
      kSuffixes, [name](std::string_view suffix) { return name.ends_with(suffix); }, &NameWithUnit::name);
  if (row == kSuffixes.end() || row->name.size() == name.size()) return {name, {}};
  return {name.substr(0, name.size() - row->name.size()), row->unit};
}

}  // namespace drivebench
