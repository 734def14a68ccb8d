#pragma once

#include <span>
#include <vector>

#include "clients/control/presets/preset.hpp"

/// The presets, one file for each family.
namespace drivebench::control {

std::span<const Preset> induction_servo_presets() noexcept;
std::span<const Preset> induction_input_output_presets() noexcept;
std::span<const Preset> induction_linearization_presets() noexcept;
std::span<const Preset> pm_presets() noexcept;
std::span<const Preset> stepper_presets() noexcept;
std::span<const Preset> bldc_presets() noexcept;
std::span<const Preset> wound_rotor_presets() noexcept;
std::span<const Preset> dc_presets() noexcept;
std::span<const Preset> wound_dc_presets() noexcept;

inline std::vector<std::span<const Preset>> preset_families() {
  return {
      induction_servo_presets(),
      induction_input_output_presets(),
      induction_linearization_presets(),
      pm_presets(),
      stepper_presets(),
      bldc_presets(),
      wound_rotor_presets(),
      dc_presets(),
      wound_dc_presets(),
  };
}

}  // namespace drivebench::control
