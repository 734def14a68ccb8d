#pragma once

#include <numbers>

#include "clients/models/induction_machine.hpp"

namespace drivebench::control {

/// The servo motor of the book, 8.2.2, as a controller knows it.
inline constexpr InductionMotorModel kServoMotor = {.machine = {.pole_pairs = 3.0,
                                                                .mutual_inductance_h = 0.0117,
                                                                .rotor_resistance_ohm = 3.9,
                                                                .rotor_inductance_h = 0.014,
                                                                .friction_nms = 1.4e-4,
                                                                .inertia_kgm2 = 1.1e-4},
                                                    .stator_resistance_ohm = 1.7,
                                                    .stator_inductance_h = 0.014};

constexpr double rad_s(double rpm) {
  return rpm * 2.0 * std::numbers::pi / 60.0;
}
constexpr double rpm(double speed_rad_s) {
  return speed_rad_s * 60.0 / (2.0 * std::numbers::pi);
}

}  // namespace drivebench::control
