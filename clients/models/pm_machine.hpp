#pragma once

namespace drivebench {

/// A client's model of a synchronous machine with permanent magnets and a round rotor, two phases or the
/// power-invariant two-phase equivalent of a star:
///   L_S·di_d/dt = −R_S·i_d + n_p·ω·L_S·i_q + u_d
///   L_S·di_q/dt = −R_S·i_q − n_p·ω·L_S·i_d − K_m·ω + u_q
///   J·dω/dt = K_m·i_q − f·ω − τ_L
/// Source: the book, (9.1) and the equations that follow from it (PM-02).
struct PmMachineModel {
  double pole_pairs;
  double resistance_ohm;
  double inductance_h;
  double torque_constant_nm_per_a;  ///< K_m, also the emf constant [V·s/rad]
  double friction_nms;              ///< viscous, f [N·m·s/rad]
  double inertia_kgm2;
  bool star = false;  ///< three phases whose two-phase equivalent this is

  /// f/J [1/s]
  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
  /// K_m/J: acceleration for one ampere of i_q.
  constexpr double acceleration_per_a() const noexcept { return torque_constant_nm_per_a / inertia_kgm2; }
};

}  // namespace drivebench
