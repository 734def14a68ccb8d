#pragma once

#include <array>
#include <vector>

#include "clients/identification/data/result.hpp"

namespace drivebench::identification {

/// What iron needs per flux: i_m/lambda_m is a polynomial in lambda_m^2 through the points of the curve and
/// 1/M at zero flux, a line in it beyond the last point.
class MagnetisingCurve {
 public:
  static constexpr int kMostPoints = 8;  ///< that without flux among them

  /// `point_a` are the currents at the fluxes `point_wb`, rising and above zero.
  MagnetisingCurve(double mutual_h, const std::vector<double>& point_wb, const std::vector<double>& point_a);

  struct Reluctance {
    double chord;  ///< i_m/lambda_m [1/H]
    double slope;  ///< its derivative by lambda_m^2
  };
  /// At the square of a flux [Wb^2].
  Reluctance at(double flux2) const noexcept {
    const double y = flux2 < reference2_ ? flux2 * per_reference2_ : 1.0;
    double value = coefficients_[last_];
    double slope = 0.0;
    for (std::size_t k = last_; k-- > 0;) {
      slope = slope * y + value;
      value = value * y + coefficients_[k];
    }
    slope *= per_reference2_;
    const double beyond = flux2 < reference2_ ? 0.0 : flux2 - reference2_;
    return {.chord = value + slope * beyond, .slope = slope};
  }
  double current_a(double flux_wb) const noexcept { return flux_wb * at(flux_wb * flux_wb).chord; }
  double largest_wb() const noexcept;
  /// Whether more flux needs more current everywhere up to the last point.
  bool rises() const noexcept;

 private:
  std::size_t last_;
  std::array<double, kMostPoints> coefficients_{};
  double reference2_;
  double per_reference2_;
};

/// The T circuit of an induction motor with a magnetising curve.
struct SaturatedCircuit {
  double rotor_resistance_ohm;
  double stator_leakage_h;
  double rotor_leakage_h;
  double mutual_h;  ///< without flux
};

/// Of R_S, T_R, L_S and sigma, those without flux, and the split s of the leakages, between -1 and 1:
/// L_R = L_S (1 - sigma)^s, of l_s = 0, equal ones at 0, and l_r = 0.
SaturatedCircuit saturated_circuit(const Result& result);
MagnetisingCurve magnetising_curve(const Result& result);

}  // namespace drivebench::identification
