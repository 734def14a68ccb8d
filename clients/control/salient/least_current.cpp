#include "clients/control/salient/least_current.hpp"

#include <cmath>

#include "plant/math/length.hpp"

namespace drivebench::control {

LeastCurrent least_current(const SalientPmModel& m, double torque_nm) noexcept {
  const double lambda_wb = m.magnet_flux_wb();
  const double delta_h = m.saliency_h();
  // The torque over i_q > 0 is convex, and the start gives too much: Newton comes down to it from there.
  const double wanted_nm = std::abs(torque_nm);
  constexpr int kMostSteps = 20;
  double i_q_a = wanted_nm / m.torque_constant_nm_per_a;
  double root_wb = lambda_wb;
  double slope_nm_per_a = m.torque_constant_nm_per_a;
  for (int k = 0; k < kMostSteps; ++k) {
    root_wb = length(lambda_wb, 2.0 * delta_h * i_q_a);
    const double half_wb = 0.5 * (lambda_wb + root_wb);
    slope_nm_per_a = m.pole_pairs * (half_wb + 2.0 * delta_h * delta_h * i_q_a * i_q_a / root_wb);
    const double excess_nm = m.pole_pairs * half_wb * i_q_a - wanted_nm;
    if (!(excess_nm > 1e-14 * wanted_nm)) break;
    i_q_a -= excess_nm / slope_nm_per_a;
  }
  const double sign = std::copysign(1.0, torque_nm);
  return {.current_a = {.d = 2.0 * delta_h * i_q_a * i_q_a / (lambda_wb + root_wb), .q = sign * i_q_a},
          .slope_a_per_nm = {.d = sign * 2.0 * delta_h * i_q_a / root_wb / slope_nm_per_a,
                             .q = 1.0 / slope_nm_per_a}};
}

double most_torque_nm(const SalientPmModel& m, double current_a) noexcept {
  const double lambda_wb = m.magnet_flux_wb();
  const double delta_a_h = m.saliency_h() * current_a;
  // With i_q² = I² − i_d² the curve is 2·δ·i_d² + λ·i_d − δ·I² = 0.
  const double i_d_a = 2.0 * delta_a_h * current_a /
                       (lambda_wb + std::sqrt(lambda_wb * lambda_wb + 8.0 * delta_a_h * delta_a_h));
  return m.torque_nm(i_d_a, std::sqrt(current_a * current_a - i_d_a * i_d_a));
}

}  // namespace drivebench::control
