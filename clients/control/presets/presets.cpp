#include "clients/control/presets/presets.hpp"

#include <algorithm>
#include <iterator>

#include "clients/control/presets/presets_families.hpp"

namespace drivebench::control {

const std::vector<Preset>& presets() {
  static const std::vector<Preset> kAll = [] {
    std::vector<Preset> all;
    for (const auto family : kPresetFamilies)
      std::ranges::move(family(), std::back_inserter(all));
    return all;
  }();
  return kAll;
}

const Preset* find_preset(std::string_view name) {
  const std::vector<Preset>& all = presets();
  const auto found = std::ranges::find(all, name, &Preset::name);
  return found == all.end() ? nullptr : &*found;
}

}  // namespace drivebench::control
