#pragma once

namespace drivebench {

/// A client's model of a two-phase induction machine, as far as field-oriented control needs it. The driven
/// machine may differ from it (a warm rotor), and no client has the true values.
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

/// The whole two-phase induction machine: the part above, and the stator, which matters wherever voltages
/// count.
struct InductionMotorModel {
  InductionMachineModel machine;
  double stator_resistance_ohm;
  double stator_inductance_h;

  /// σ = 1 − M²/(L_R·L_S)
  constexpr double leakage() const noexcept {
    return 1.0 - machine.mutual_inductance_h * machine.mutual_inductance_h /
                     (machine.rotor_inductance_h * stator_inductance_h);
  }
  /// σ·L_S [H]
  constexpr double leakage_inductance_h() const noexcept { return leakage() * stator_inductance_h; }
  /// M/L_R: of a change of rotor flux, the share that the stator sees.
  constexpr double stator_share() const noexcept {
    return machine.mutual_inductance_h / machine.rotor_inductance_h;
  }
  /// β = M/(σ·L_R·L_S) [A/Wb]
  constexpr double current_per_wb() const noexcept { return stator_share() / leakage_inductance_h(); }
  /// γ = M²·R_R/(σ·L_R²·L_S) + R_S/(σ·L_S) [1/s], the rate at which stator currents decay.
  constexpr double current_decay_per_s() const noexcept {
    return (stator_share() * stator_share() * machine.rotor_resistance_ohm + stator_resistance_ohm) /
           leakage_inductance_h();
  }
  /// T_S = L_S/R_S
  constexpr double stator_time_s() const noexcept { return stator_inductance_h / stator_resistance_ohm; }
  /// k_t = n_p·M²/L_R: steady torque = k_t·i_d·i_q [N·m/A²].
  constexpr double torque_nm_per_a2() const noexcept {
    return machine.pole_pairs * machine.mutual_inductance_h * stator_share();
  }
};

}  // namespace drivebench
