#include "clients/identification/data/magnetising_curve.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>

#include "plant/math/exponential.hpp"

namespace drivebench::identification {

MagnetisingCurve::MagnetisingCurve(double mutual_h, const std::vector<double>& point_wb,
                                   const std::vector<double>& point_a)
    : last_(point_wb.size()),
      reference2_(point_wb.back() * point_wb.back()),
      per_reference2_(1.0 / reference2_) {
  const auto points = static_cast<Eigen::Index>(last_ + 1);
  Eigen::MatrixXd powers = Eigen::MatrixXd::Zero(points, points);
  Eigen::VectorXd values(points);
  powers(0, 0) = 1.0;
  values(0) = 1.0 / mutual_h;
  for (std::size_t k = 0; k < last_; ++k) {
    const auto row = static_cast<Eigen::Index>(k + 1);
    const double y = point_wb[k] * point_wb[k] * per_reference2_;
    double power = 1.0;
    for (Eigen::Index n = 0; n < points; ++n, power *= y)
      powers(row, n) = power;
    values(row) = point_a[k] / point_wb[k];
  }
  const Eigen::VectorXd found = powers.partialPivLu().solve(values);
  for (std::size_t k = 0; k <= last_; ++k)
    coefficients_[k] = found(static_cast<Eigen::Index>(k));
}

double MagnetisingCurve::largest_wb() const noexcept {
  return std::sqrt(reference2_);
}

bool MagnetisingCurve::rises() const noexcept {
  constexpr int kPlaces = 200;
  for (int k = 0; k <= kPlaces; ++k) {
    const double flux2 = reference2_ * k * k / (kPlaces * kPlaces);
    const Reluctance here = at(flux2);
    if (!(here.chord + 2.0 * flux2 * here.slope > 0.0)) return false;  // di_m/dlambda_m
  }
  return true;
}

SaturatedCircuit saturated_circuit(const Result& r) {
  const double stator_h = r.at("L_S");
  const double coupling = 1.0 - r.at("sigma");
  const double split = r.at("split");
  const double rotor_h = stator_h * power(coupling, split);
  const double mutual_h = stator_h * power(coupling, 0.5 * (1.0 + split));
  return {.rotor_resistance_ohm = rotor_h / r.at("T_R"),
          .stator_leakage_h = stator_h - mutual_h,
          .rotor_leakage_h = rotor_h - mutual_h,
          .mutual_h = mutual_h};
}

MagnetisingCurve magnetising_curve(const Result& r) {
  std::vector<double> currents;
  for (const double flux_wb : r.curve_wb)
    currents.push_back(r.at(curve_name(flux_wb)));
  return {saturated_circuit(r).mutual_h, r.curve_wb, currents};
}

}  // namespace drivebench::identification
