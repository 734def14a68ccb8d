#pragma once

#include "plant/drive/supply/current_trend.hpp"

namespace drivebench {

/// Section [axis.transformer]: one transformer for each phase, between the source and its contactor. With i_1
/// into the primary, i_2 out of the secondary into the machine, n = N_2/N_1 and the magnetising current i_m
/// on the primary's side:
///   v_1 = R_1·i_1 + L_l1·i_1' + L_m·i_m'          i_1 = i_m + n·i_2
///   v_2 = n·L_m·i_m' − R_2·i_2 − L_l2·i_2'
/// The phases do not see each other: primaries in a star whose neutral is that of the source, secondaries
/// like the machine's windings (in a star without a neutral). No saturation, no core loss. Source: the book,
/// section 7.4.3; tag GRID-01 has the same n, and L_m on the same side.
struct TransformerParameters {
  double turns_ratio = 0.0;               ///< n: secondary over primary; 0: no transformer
  double primary_resistance_ohm = 0.0;    ///< R_1
  double primary_leakage_h = 0.0;         ///< L_l1
  double magnetising_inductance_h = 0.0;  ///< L_m
  double secondary_resistance_ohm = 0.0;  ///< R_2
  double secondary_leakage_h = 0.0;       ///< L_l2
};

constexpr bool has_transformer(const TransformerParameters& p) noexcept {
  return p.turns_ratio > 0.0;
}

/// The transformer as a voltage behind an impedance. The primary's flux linkage λ = L_l1·i_1 + L_m·i_m is its
/// only state: i_m = (λ − L_l1·n·i_2)/(L_l1 + L_m) takes the slope of i_2 out of λ' and puts it into an
/// inductance. With k = L_m/(L_l1 + L_m) and a = R_1/(L_l1 + L_m)
///   λ'  = v_1 − a·λ − k·n·R_1·i_2
///   v_2 = k·n·(v_1 − a·λ) − (R_2 + (k·n)²·R_1)·i_2 − (L_l2 + k·n²·L_l1)·i_2'
struct TransformerConstants {
  double gain = 0.0;            ///< k·n
  double decay_per_s = 0.0;     ///< a
  double coupling_ohm = 0.0;    ///< k·n·R_1
  double resistance_ohm = 0.0;  ///< behind which the secondary is a voltage source
  double inductance_h = 0.0;
};
/// All zero without a transformer.
TransformerConstants constants_of(const TransformerParameters& p) noexcept;

/// All that the transformer of one phase remembers. At rest it has no flux: the source of tick 0 energises
/// it, and a direct component of its flux decays with rate a. 8-byte members only.
struct TransformerPhase {
  double flux_wb = 0.0;    ///< λ
  CurrentTrend current{};  ///< of i_2
};

/// A quantity at the start, in the middle and at the end of an interval.
struct Course {
  double start;
  double middle;
  double end;
};

/// λ in an interval, in the middle to the fourth order, at the end by a Runge-Kutta step.
Course flux_course_wb(const TransformerConstants& c, double flux_wb, const Course& primary_v,
                      const Course& secondary_a, double duration_s) noexcept;

/// The voltage k·n·(v_1 − a·λ) in an interval at whose start i_2 is current_a.
Course secondary_course_v(const TransformerConstants& c, const TransformerPhase& x, const Course& primary_v,
                          double current_a, double duration_s) noexcept;

/// The transformer after an interval with these currents i_2 at its ends.
TransformerPhase magnetised(const TransformerConstants& c, const TransformerPhase& x, const Course& primary_v,
                            double from_a, double to_a, double duration_s) noexcept;

}  // namespace drivebench
