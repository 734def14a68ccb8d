#pragma once

namespace drivebench {

/// A client's model of a synchronous machine with permanent magnets and a salient rotor, two phases or the
/// power-invariant two-phase equivalent of a star:
///   L_d·di_d/dt = −R_S·i_d + n_p·ω·L_q·i_q + u_d
///   L_q·di_q/dt = −R_S·i_q − n_p·ω·(L_d·i_d + λ) + u_q        with λ = K_m/n_p
///   J·dω/dt = n_p·(λ + (L_d − L_q)·i_d)·i_q − f·ω − τ_L
/// Source: the book, problem 9.11 (ST-06), L_d = L_S + L_g, L_q = L_S − L_g; its printed torque
/// and d-equation are corrected.
struct SalientPmModel {
  double pole_pairs;
  double resistance_ohm;
  double inductance_d_h;
  double inductance_q_h;
  double torque_constant_nm_per_a;  ///< K_m, also the emf constant [V·s/rad]
  double friction_nms;              ///< viscous, f [N·m·s/rad]
  double inertia_kgm2;
  bool star = false;  ///< three phases whose two-phase equivalent this is

  /// λ: flux of the magnet in the stator windings [Wb]
  constexpr double magnet_flux_wb() const noexcept { return torque_constant_nm_per_a / pole_pairs; }
  /// L_d − L_q: negative where the magnets lie in the way of the d axis
  constexpr double saliency_h() const noexcept { return inductance_d_h - inductance_q_h; }
  constexpr double torque_nm(double i_d_a, double i_q_a) const noexcept {
    return pole_pairs * (magnet_flux_wb() + saliency_h() * i_d_a) * i_q_a;
  }
  /// f/J [1/s]
  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
};

}  // namespace drivebench
