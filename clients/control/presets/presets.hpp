#pragma once

#include <string_view>
#include <vector>

#include "clients/control/presets/preset.hpp"

namespace drivebench::control {

/// All presets of all families, in the order of presets/presets_families.hpp.
const std::vector<Preset>& presets();

/// nullptr when there is none of that name.
const Preset* find_preset(std::string_view name);

}  // namespace drivebench::control
