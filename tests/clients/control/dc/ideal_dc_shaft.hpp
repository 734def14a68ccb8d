#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "clients/control/loop/controller.hpp"

namespace drivebench::control {

/// The shaft of DC-A under an ideal current, solved exactly from sample to sample: J·ω' = K_T·i − f·ω − τ_L.
struct IdealDcShaft {
  double torque_constant_nm_per_a = 0.07;
  double inertia_kgm2 = 6e-5;
  double friction_nms = 4e-4;
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;

  void step(double current_a, double load_nm, double period_s) {
    const double rate = friction_nms / inertia_kgm2;
    const double end_rad_s = (torque_constant_nm_per_a * current_a - load_nm) / friction_nms;
    const double share = -std::expm1(-rate * period_s);
    angle_rad += end_rad_s * period_s + (speed_rad_s - end_rad_s) * share / rate;
    speed_rad_s += (end_rad_s - speed_rad_s) * share;
  }

  std::int64_t count(double counts_per_revolution) const {
    return static_cast<std::int64_t>(
        std::floor(angle_rad * counts_per_revolution / (2.0 * std::numbers::pi)));
  }
};

/// So fine that the encoder does not matter.
inline constexpr double kFineCounts = 1e9;

}  // namespace drivebench::control
