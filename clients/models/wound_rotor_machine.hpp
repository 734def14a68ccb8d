#pragma once

namespace drivebench {

/// A client's model of a synchronous machine with a field winding, in the frame of the field, two phases or
/// the two-phase equivalent of a star:
///   u_d = R_S·i_d + L_S·di_d/dt + M·di_F/dt − n_p·ω·L_S·i_q
///   u_q = R_S·i_q + L_S·di_q/dt + n_p·ω·(L_S·i_d + M·i_F)
///   u_F = R_F·i_F + L_F·di_F/dt + M·di_d/dt
///   J·dω/dt = n_p·M·i_F·i_q − f·ω − τ_L
/// Source: the book, (6.38) and problem 6.14, whose print lacks n_p in the torque (SM-01, SM-03).
struct WoundRotorModel {
  double pole_pairs;
  double stator_resistance_ohm;
  double stator_inductance_h;
  double field_resistance_ohm;
  double field_inductance_h;
  double mutual_inductance_h;
  double friction_nms;  ///< viscous, f [N·m·s/rad]
  double inertia_kgm2;
  bool star = false;

  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
};

}  // namespace drivebench
