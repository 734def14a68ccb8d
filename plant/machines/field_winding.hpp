#pragma once

#include "plant/math/curve.hpp"

namespace drivebench {

/// The iron of a field winding: flux linkage lambda_f(i_f), odd, without hysteresis. Either L_f i_f or a
/// saturation curve of [Wb] over [A] that starts at (0, 0) and rises; beyond its end the last slope goes on.
/// A machine may have its field in one loop with an inductance: series_h.
struct FieldWinding {
  Curve saturation_curve{};  ///< empty: not saturated
  double inductance_h;       ///< L_f; without a curve
  double per_inductance;     ///< 1/L_f [1/H]; without a curve
  double series_h;
  double per_loop_inductance;  ///< 1/(L_f + series_h) [1/H]; without a curve
  double loop_share;           ///< L_f/(L_f + series_h): of the flux linkage of the loop; without a curve
};

FieldWinding field_winding(double inductance_h, const Curve& saturation_curve, double series_h) noexcept;

/// The current at which the curve plus series_h i is the flux linkage.
double saturated_current_a(const Curve& curve, double flux_wb, double series_h) noexcept;

/// i_f = f^-1(lambda_f).
inline double field_current_a(const FieldWinding& f, double flux_wb) noexcept {
  if (f.saturation_curve.empty()) return flux_wb * f.per_inductance;
  return saturated_current_a(f.saturation_curve, flux_wb, 0.0);
}

/// i with lambda_f(i) + series_h i = flux: the field and the inductance in one loop.
inline double loop_current_a(const FieldWinding& f, double flux_wb) noexcept {
  if (f.saturation_curve.empty()) return flux_wb * f.per_loop_inductance;
  return saturated_current_a(f.saturation_curve, flux_wb, f.series_h);
}

/// 1/(dlambda_f/di + series_h) at a current [1/H].
double saturated_per_loop_inductance(const FieldWinding& f, double current_a) noexcept;
inline double differential_per_loop_inductance(const FieldWinding& f, double current_a) noexcept {
  return f.saturation_curve.empty() ? f.per_loop_inductance : saturated_per_loop_inductance(f, current_a);
}

/// Magnetic energy of the field: the integral of i_f over lambda_f.
double field_energy_j(const FieldWinding& f, double current_a) noexcept;

/// The least dlambda_f/di_f.
double smallest_inductance_h(double inductance_h, const Curve& saturation_curve) noexcept;

}  // namespace drivebench
