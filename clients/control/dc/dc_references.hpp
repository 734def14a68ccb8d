#pragma once

#include "clients/control/moves/trajectory.hpp"
#include "clients/models/dc_machine.hpp"

// The armature of a DC motor that follows a trajectory without error.
namespace drivebench::control {

/// i_ref = (J·α + f·ω)/K_T
constexpr double reference_current_a(const DcMachineModel& m, const Reference& r) noexcept {
  return (m.inertia_kgm2 * r.acceleration_rad_s2 + m.friction_nms * r.speed_rad_s) /
         m.torque_constant_nm_per_a;
}

/// v_ref = L·di_ref/dt + R·i_ref + K_b·ω
constexpr double reference_voltage_v(const DcMachineModel& m, const Reference& r) noexcept {
  const double slope_a_per_s =
      (m.inertia_kgm2 * r.jerk_rad_s3 + m.friction_nms * r.acceleration_rad_s2) / m.torque_constant_nm_per_a;
  return m.inductance_h * slope_a_per_s + m.resistance_ohm * reference_current_a(m, r) +
         m.torque_constant_nm_per_a * r.speed_rad_s;
}

}  // namespace drivebench::control
