#pragma once

#include <span>
#include <vector>

#include "clients/control/preset.hpp"

/// The presets, one file for each family.
namespace drivebench::control {

std::span<const Preset> induction_servo_presets() noexcept;

inline std::vector<std::span<const Preset>> preset_families() {
  return {
      induction_servo_presets(),
  };
}

}  // namespace drivebench::control
