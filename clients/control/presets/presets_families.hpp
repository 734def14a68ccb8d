#pragma once

#include <vector>

#include "clients/control/presets/preset.hpp"

/// The presets, one file for each family.
namespace drivebench::control {

std::vector<Preset> induction_servo_presets();
std::vector<Preset> induction_input_output_presets();
std::vector<Preset> induction_linearization_presets();
std::vector<Preset> pm_presets();
std::vector<Preset> salient_pm_presets();
std::vector<Preset> stepper_presets();
std::vector<Preset> two_motor_presets();
std::vector<Preset> bldc_presets();
std::vector<Preset> wound_rotor_presets();
std::vector<Preset> dc_presets();
std::vector<Preset> wound_dc_presets();

/// In the order of lists.
inline constexpr auto kPresetFamilies = {
    induction_servo_presets,
    induction_input_output_presets,
    induction_linearization_presets,
    pm_presets,
    salient_pm_presets,
    stepper_presets,
    two_motor_presets,
    bldc_presets,
    wound_rotor_presets,
    dc_presets,
    wound_dc_presets,
};

}  // namespace drivebench::control
