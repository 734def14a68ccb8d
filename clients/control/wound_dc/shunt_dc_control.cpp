#include "clients/control/wound_dc/shunt_dc_control.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace drivebench::control {
namespace {

/// CTL-13 without its loop: the voltage that gives this acceleration.
double accelerating_v(const WoundDcModel& m, const WoundDcState& x, double divisor_wb,
                      double acceleration_rad_s2) noexcept {
  return m.motor_constant * x.flux_wb * x.speed_rad_s +
         acceleration_rad_s2 * m.inertia_kgm2 * m.armature_resistance_ohm / (m.motor_constant * divisor_wb);
}

}  // namespace

std::vector<std::string> ShuntDcParameters::problems() const {
  return wound_dc_problems(*this, Polynomial<2>{speed_proportional_per_s, speed_integral_per_s2},
                           "speed.integral_per_s2 and the gain beside it make the speed loop unstable");
}

Setpoint ShuntDcController::voltages(const Reference& r, const WoundDcState& x) noexcept {
  speed_error_rad_s_ = r.speed_rad_s - x.speed_rad_s;
  const double acceleration = r.acceleration_rad_s2 + p_.speed_proportional_per_s * speed_error_rad_s_ +
                              p_.speed_integral_per_s2 * speed_integral_rad_;
  return {.a = accelerating_v(machine(), x, divisor_wb(x.flux_wb), acceleration)};
}

void ShuntDcController::integrate(const Setpoint& excess_v) noexcept {
  speed_integral_rad_ = integrated(speed_integral_rad_, speed_error_rad_s_, excess_v.a);
}

ShuntDcChain ShuntDcChain::at(const WoundDcModel& m, double flux_wb, double speed_rad_s) noexcept {
  const double k_m = m.motor_constant;
  const double torque = k_m / (m.inertia_kgm2 * m.armature_resistance_ohm);  // K_m/(J·R)
  const double square = flux_wb * flux_wb;
  const double field_rate = m.field_resistance_ohm / m.flux_slope_h(0.0);  // R_F/L_f
  const double back_emf = k_m * torque * square;                           // K_m²·λ²/(J·R)
  const double headroom = field_rate - k_m * speed_rad_s;
  return {.z1_rad_s = speed_rad_s - 0.5 * torque * square,
          .z2_rad_s2 = torque * square * headroom,
          .alpha_rad_s3 = -2.0 * field_rate * torque * square * headroom + back_emf * back_emf * speed_rad_s,
          .beta_rad_s3_per_v = torque * flux_wb * (2.0 * headroom - back_emf),
          .load_gain_per_s = back_emf};
}

double ShuntDcChain::holding_flux_wb(const WoundDcModel& m, double speed_rad_s, double load_nm) noexcept {
  const double headroom = m.field_resistance_ohm / m.flux_slope_h(0.0) - m.motor_constant * speed_rad_s;
  return std::sqrt(std::max(load_nm, 0.0) * m.armature_resistance_ohm /
                   (m.motor_constant * std::max(headroom, 1e-3)));
}

std::vector<std::string> ExactShuntDcParameters::problems() const {
  return wound_dc_problems(*this, Polynomial<2>{chain_derivative_per_s, chain_proportional_per_s2},
                           "chain.proportional_per_s2 and the gain beside it make the loop unstable");
}

Setpoint ExactShuntDcController::voltages(const Reference& r, const WoundDcState& x) noexcept {
  const WoundDcModel& m = machine();
  const ShuntDcChain chain = ShuntDcChain::at(m, x.flux_wb, x.speed_rad_s);
  if (chain.beta_rad_s3_per_v < p_.least_beta_rad_s3_per_v) {
    const double acceleration = r.acceleration_rad_s2 + p_.start_per_s * (r.speed_rad_s - x.speed_rad_s);
    return {.a = accelerating_v(m, x, divisor_wb(x.flux_wb), acceleration)};
  }
  const double load_rad_s2 = x.load_rad_s2 + m.friction_rate_per_s() * x.speed_rad_s;
  const double wanted_nm = m.inertia_kgm2 * (load_rad_s2 + r.acceleration_rad_s2);
  const ShuntDcChain target =
      ShuntDcChain::at(m, ShuntDcChain::holding_flux_wb(m, r.speed_rad_s, wanted_nm), r.speed_rad_s);
  const double wanted_rad_s3 = p_.chain_proportional_per_s2 * (target.z1_rad_s - chain.z1_rad_s) +
                               p_.chain_derivative_per_s * (target.z2_rad_s2 - chain.z2_rad_s2);
  return {.a = (wanted_rad_s3 - chain.alpha_rad_s3 - chain.load_gain_per_s * load_rad_s2) /
               chain.beta_rad_s3_per_v};
}

}  // namespace drivebench::control
