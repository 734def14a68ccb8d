#pragma once

#include <cmath>

namespace drivebench {

/// The windings of an induction machine, of the two-phase equivalent or a phase of a three-phase star, which
/// are the same numbers (power-invariant transform). Positive; M² < L_S·L_R.
struct InductionWindings {
  double stator_resistance_ohm;
  double rotor_resistance_ohm;
  double stator_inductance_h;
  double rotor_inductance_h;
  double mutual_inductance_h;

  /// σ = 1 − M²/(L_S·L_R), the same whatever the turns of the rotor.
  constexpr double leakage() const noexcept {
    return 1.0 - mutual_inductance_h * mutual_inductance_h / (stator_inductance_h * rotor_inductance_h);
  }
  constexpr double rotor_time_s() const noexcept { return rotor_inductance_h / rotor_resistance_ohm; }

  /// The same machine, its rotor wound with `turns` as many turns: M and the rotor's numbers change, what the
  /// terminals and the shaft see does not.
  constexpr InductionWindings with_turns(double turns) const noexcept {
    InductionWindings other = *this;
    other.rotor_resistance_ohm *= turns * turns;
    other.rotor_inductance_h *= turns * turns;
    other.mutual_inductance_h *= turns;
    return other;
  }

  // Turns of the rotor that move the leakage. Source: the book, exercises 13 to 16, 21 and 22 of chapter 7
  // (P3-15).
  /// Γ circuit: all leakage is the rotor's, σ·L_S/(1 − σ); M = L_S.
  constexpr double turns_of_gamma() const noexcept { return stator_inductance_h / mutual_inductance_h; }
  /// Inverse Γ circuit: all leakage is the stator's, σ·L_S; M = (1 − σ)·L_S.
  constexpr double turns_of_inverse_gamma() const noexcept {
    return mutual_inductance_h / rotor_inductance_h;
  }
  /// T circuit with the leakage shared equally, L_R = L_S.
  double turns_of_equal_leakages() const noexcept {
    return std::sqrt(stator_inductance_h / rotor_inductance_h);
  }
};

/// The T circuit of a phase: a leakage on each side of the magnetising inductance. A leakage may be negative
/// where the turns of the rotor shift it to the other side.
struct InductionTCircuit {
  double stator_resistance_ohm;
  double rotor_resistance_ohm;
  double stator_leakage_h;
  double rotor_leakage_h;
  double magnetizing_h;
};

constexpr InductionTCircuit t_circuit_of(const InductionWindings& w) noexcept {
  return {.stator_resistance_ohm = w.stator_resistance_ohm,
          .rotor_resistance_ohm = w.rotor_resistance_ohm,
          .stator_leakage_h = w.stator_inductance_h - w.mutual_inductance_h,
          .rotor_leakage_h = w.rotor_inductance_h - w.mutual_inductance_h,
          .magnetizing_h = w.mutual_inductance_h};
}

constexpr InductionWindings windings_of(const InductionTCircuit& t) noexcept {
  return {.stator_resistance_ohm = t.stator_resistance_ohm,
          .rotor_resistance_ohm = t.rotor_resistance_ohm,
          .stator_inductance_h = t.magnetizing_h + t.stator_leakage_h,
          .rotor_inductance_h = t.magnetizing_h + t.rotor_leakage_h,
          .mutual_inductance_h = t.magnetizing_h};
}

}  // namespace drivebench
