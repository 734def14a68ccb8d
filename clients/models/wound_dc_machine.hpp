#pragma once

#include <array>
#include <cstddef>

namespace drivebench {

/// Flux linkage of a field winding over its current: piecewise linear from (0, 0) on, odd; the last piece
/// goes on for ever.
struct FieldCurve {
  struct Point {
    double current_a;
    double flux_wb;
  };
  static constexpr std::size_t kMaxPoints = 8;
  std::array<Point, kMaxPoints> points;  ///< the first is (0, 0), currents and fluxes rise
  std::size_t count;                     ///< at least 2

  /// Without saturation.
  static constexpr FieldCurve linear(double inductance_h) noexcept {
    return {.points = {{{0.0, 0.0}, {1.0, inductance_h}}}, .count = 2};
  }
  constexpr double flux_wb(double current_a) const noexcept {
    const double magnitude_a = current_a < 0.0 ? -current_a : current_a;
    const std::size_t k = piece(magnitude_a);
    const double flux = points[k].flux_wb + slope_of(k) * (magnitude_a - points[k].current_a);
    return current_a < 0.0 ? -flux : flux;
  }
  /// dλ_f/di_f [H]
  constexpr double slope_h(double current_a) const noexcept {
    return slope_of(piece(current_a < 0.0 ? -current_a : current_a));
  }

 private:
  constexpr std::size_t piece(double magnitude_a) const noexcept {
    std::size_t k = 0;
    while (k + 2 < count && magnitude_a >= points[k + 1].current_a)
      ++k;
    return k;
  }
  constexpr double slope_of(std::size_t k) const noexcept {
    return (points[k + 1].flux_wb - points[k].flux_wb) / (points[k + 1].current_a - points[k].current_a);
  }
};

/// A client's model of a DC machine with a wound field: torque K_m·λ_f·i, back-emf K_m·λ_f·ω.
struct WoundDcModel {
  double armature_resistance_ohm;     ///< R
  double armature_inductance_h;       ///< L
  double motor_constant;              ///< K_m
  double field_resistance_ohm;        ///< R_f; of a shunt machine with its adjusting resistor, R_F
  double field_flux_scale;            ///< of the curve: 1 if it is right
  double field_shunt_resistance_ohm;  ///< R_p across the field of a series machine; 0: none
  double inertia_kgm2;
  double friction_nms;  ///< viscous [N·m·s/rad]
  FieldCurve field;

  constexpr double flux_wb(double field_a) const noexcept {
    return field_flux_scale * field.flux_wb(field_a);
  }
  constexpr double flux_slope_h(double field_a) const noexcept {
    return field_flux_scale * field.slope_h(field_a);
  }
  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
  constexpr double torque_nm(double flux_wb, double armature_a) const noexcept {
    return motor_constant * flux_wb * armature_a;
  }
};

}  // namespace drivebench
