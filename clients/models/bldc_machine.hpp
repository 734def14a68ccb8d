#pragma once

#include <algorithm>
#include <cmath>

namespace drivebench {

/// A client's model of a brushless DC machine with trapezoidal emf, an isolated star:
///   (L_S + M)·di_k/dt = u_k − v_N − R_S·i_k + e_p·ω·e(n_p·θ − (k−1)·120°)
///   J·dω/dt = −τ_p·Σ e_k·i_k − f·ω − τ_L        with τ_p = e_p
/// The emf has the sense of the terminal voltage, so that a motor takes currents of the sign opposite to e.
/// Source: the book, chapter 10 (BL-01).
struct BldcMachineModel {
  double pole_pairs;
  double resistance_ohm;            ///< per phase
  double torque_constant_nm_per_a;  ///< τ_p of a phase, also e_p [V·s/rad]
  double friction_nms;              ///< viscous, f [N·m·s/rad]
  double inertia_kgm2;
  double inductance_h = 0.0;  ///< L_S + M; the controllers do without it

  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
  /// 2·τ_p/J: two phases carry the current.
  constexpr double acceleration_per_a() const noexcept {
    return 2.0 * torque_constant_nm_per_a / inertia_kgm2;
  }
};

/// e over the electrical angle, in turns: 0 at 0, rising to 1 at 30°, falling from 150° on, −1 from 210° to
/// 330°. Source: the book, (10.7)-(10.8) (BL-02).
inline double trapezoid_at_turns(double turns) noexcept {
  // A triangle of height 3 around the middle of the top, a quarter turn after the rise, cut off at 1.
  const double from_middle = turns - 0.25;
  return std::clamp(3.0 - 12.0 * std::abs(from_middle - std::round(from_middle)), -1.0, 1.0);
}

}  // namespace drivebench
