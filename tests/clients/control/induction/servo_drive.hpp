#pragma once

#include <cmath>

#include "clients/control/induction/induction_drive.hpp"
#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control {

inline constexpr InductionDriveParameters kServoDrive = {
    .motor = kServoMotor,
    .sample_rate_hz = 8000.0,
    .counts_per_revolution = 2000.0,
    .voltage_limit_v = 80.0,
    .current_limit_a = 6.0,
    .quadrature_reference_limit_a = 8.0,
    .speed_observer = {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}};

/// Feeds a controller at standstill with the direct current that builds up this flux, as long as it takes.
template <class C>
void magnetise(C& controller, double i_d_a, int samples = 800) {
  for (int k = 0; k < samples; ++k)
    controller.update({.i_a_a = i_d_a}, {});
}

inline double telemetry_of(const Controller& controller, std::string_view name) {
  const auto names = controller.telemetry_names();
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == name) return controller.telemetry()[i];
  }
  return std::nan("");
}

}  // namespace drivebench::control
