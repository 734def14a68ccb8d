#pragma once

namespace drivebench::control {

/// What the controller believes about a two-phase induction machine. It is the controller's own copy: the
/// machine it drives may differ (a warm rotor), and no client knows the true one.
struct InductionMachineModel {
  double pole_pairs;
  double mutual_inductance_h;
  double rotor_resistance_ohm;
  double rotor_inductance_h;
  double friction_nms;  ///< viscous, f [N·m·s/rad]
  double inertia_kgm2;

  /// η = R_R/L_R [1/s], the rate at which the rotor flux decays.
  constexpr double flux_decay_per_s() const noexcept { return rotor_resistance_ohm / rotor_inductance_h; }
  /// f/J [1/s]
  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
  /// μ = n_p·M/(J·L_R): acceleration = μ·ψ_d·i_q.
  constexpr double acceleration_per_wb_a() const noexcept {
    return pole_pairs * mutual_inductance_h / (inertia_kgm2 * rotor_inductance_h);
  }
};

}  // namespace drivebench::control
