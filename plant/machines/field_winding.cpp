#include "plant/machines/field_winding.hpp"

#include <algorithm>
#include <cmath>

namespace drivebench {
namespace {

/// 0 where a saturation curve takes the place of the inductance.
double inverse(double inductance_h) noexcept {
  return inductance_h > 0.0 ? 1.0 / inductance_h : 0.0;
}

}  // namespace

FieldWinding field_winding(double inductance_h, const Curve& saturation_curve, double series_h) noexcept {
  return {.saturation_curve = saturation_curve,
          .inductance_h = inductance_h,
          .per_inductance = inverse(inductance_h),
          .series_h = series_h,
          .per_loop_inductance = inverse(inductance_h + series_h),
          .loop_share = inductance_h > 0.0 ? inductance_h / (inductance_h + series_h) : 0.0};
}

double saturated_current_a(const Curve& curve, double flux_wb, double series_h) noexcept {
  return std::copysign(curve.inverse(std::abs(flux_wb), series_h), flux_wb);
}

double saturated_per_loop_inductance(const FieldWinding& f, double current_a) noexcept {
  return 1.0 / (f.saturation_curve.slope(std::abs(current_a)) + f.series_h);
}

double field_energy_j(const FieldWinding& f, double current_a) noexcept {
  if (f.saturation_curve.empty()) return 0.5 * f.inductance_h * current_a * current_a;
  const double size_a = std::abs(current_a);
  return size_a * f.saturation_curve.value(size_a) - f.saturation_curve.area(size_a);
}

double smallest_inductance_h(double inductance_h, const Curve& saturation_curve) noexcept {
  if (saturation_curve.empty()) return inductance_h;
  double least_h = saturation_curve.slope(0.0);
  for (const CurvePoint& point : saturation_curve.points())
    least_h = std::min(least_h, saturation_curve.slope(point.x));
  return least_h;
}

}  // namespace drivebench
