#pragma once

namespace drivebench {

/// A client's model of a DC machine with permanent magnets; K_b = K_T in SI units:
///   L·di/dt = u − R·i − K_T·ω
///   J·dω/dt = K_T·i − f·ω − τ_L
/// Source: the book, 2.7.
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
};

}  // namespace drivebench
