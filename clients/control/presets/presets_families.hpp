#pragma once

#include <vector>

#include "clients/control/presets/preset.hpp"

/// The presets, one file and one namespace for each family: families name what is alike in them alike.
namespace drivebench::control {

namespace induction_servo_presets {
std::vector<Preset> all();
}
namespace induction_input_output_presets {
std::vector<Preset> all();
}
namespace induction_linearization_presets {
std::vector<Preset> all();
}
namespace pm_presets {
std::vector<Preset> all();
}
namespace salient_pm_presets {
std::vector<Preset> all();
}
namespace stepper_presets {
std::vector<Preset> all();
}
namespace two_motor_presets {
std::vector<Preset> all();
}
namespace bldc_presets {
std::vector<Preset> all();
}
namespace wound_rotor_presets {
std::vector<Preset> all();
}
namespace dc_presets {
std::vector<Preset> all();
}
namespace wound_dc_presets {
std::vector<Preset> all();
}

/// In the order of lists.
inline constexpr auto kPresetFamilies = {
    induction_servo_presets::all,
    induction_input_output_presets::all,
    induction_linearization_presets::all,
    pm_presets::all,
    salient_pm_presets::all,
    stepper_presets::all,
    two_motor_presets::all,
    bldc_presets::all,
    wound_rotor_presets::all,
    dc_presets::all,
    wound_dc_presets::all,
};

}  // namespace drivebench::control
