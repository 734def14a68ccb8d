#pragma once

#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// What a controller believes about a DC machine with permanent magnets; K_b = K_T in SI units.
struct DcMachineModel {
  double resistance_ohm;
  double inductance_h;
  double torque_constant_nm_per_a;  ///< K_T
  double inertia_kgm2;
  double friction_nms;  ///< viscous, f [N·m·s/rad]

  /// f/J [1/s]
  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
  /// K_T/J: the acceleration that an ampere gives.
  constexpr double acceleration_per_a() const noexcept { return torque_constant_nm_per_a / inertia_kgm2; }
  /// i_ref = (J·α + f·ω)/K_T
  constexpr double current_a(const Reference& r) const noexcept {
    return (inertia_kgm2 * r.acceleration_rad_s2 + friction_nms * r.speed_rad_s) / torque_constant_nm_per_a;
  }
  /// v_ref = L·di_ref/dt + R·i_ref + K_b·ω
  constexpr double voltage_v(const Reference& r) const noexcept {
    const double slope_a_per_s =
        (inertia_kgm2 * r.jerk_rad_s3 + friction_nms * r.acceleration_rad_s2) / torque_constant_nm_per_a;
    return inductance_h * slope_a_per_s + resistance_ohm * current_a(r) +
           torque_constant_nm_per_a * r.speed_rad_s;
  }
};

}  // namespace drivebench::control
