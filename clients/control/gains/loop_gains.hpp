#pragma once

#include <tuple>

#include "clients/control/gains/gains.hpp"
#include "clients/control/math/pole_placement.hpp"

// Gains that controllers of several machines have.
namespace drivebench::control {

/// PI control of a current: u = K_P·e + K_I·∫e; K_I = 0 is the P loop.
struct CurrentGains {
  double proportional_v_per_a;
  double integral_v_per_as;

  static constexpr std::tuple kGains{
      gain("proportional_v_per_a", &CurrentGains::proportional_v_per_a, GainRule::kNotNegative),
      gain("integral_v_per_as", &CurrentGains::integral_v_per_as, GainRule::kNotNegative)};
};

/// Gains on ∫e, e and its derivative. Where friction is fed forward or left out, the polynomial of the loop
/// is s³ + K2·s² + K1·s + K0.
struct ServoGains {
  double integral_per_s3;      ///< K0; 0: no integral
  double proportional_per_s2;  ///< K1
  double derivative_per_s;     ///< K2

  static constexpr std::tuple kGains{
      gain("integral_per_s3", &ServoGains::integral_per_s3, GainRule::kNotNegative),
      gain("proportional_per_s2", &ServoGains::proportional_per_s2, GainRule::kNotNegative),
      gain("derivative_per_s", &ServoGains::derivative_per_s, GainRule::kNotNegative)};

  /// Poles −r1, −r2, −r3.
  static constexpr ServoGains placed(double r1, double r2, double r3) noexcept {
    return {.integral_per_s3 = r1 * r2 * r3,
            .proportional_per_s2 = r1 * r2 + r1 * r3 + r2 * r3,
            .derivative_per_s = r1 + r2 + r3};
  }
  /// For a shaft whose friction f/J stays in the loop: s³ + (K2 + f/J)·s² + K1·s + K0.
  static constexpr ServoGains placed(const Polynomial<3>& poles, double friction_rate_per_s = 0.0) noexcept {
    return {.integral_per_s3 = poles[2],
            .proportional_per_s2 = poles[1],
            .derivative_per_s = poles[0] - friction_rate_per_s};
  }
  /// Without an integral: s² + (K2 + f/J)·s + K1.
  static constexpr ServoGains placed(const Polynomial<2>& poles, double friction_rate_per_s) noexcept {
    return {.integral_per_s3 = 0.0,
            .proportional_per_s2 = poles[1],
            .derivative_per_s = poles[0] - friction_rate_per_s};
  }
};

/// PI control of a rotor flux.
struct FluxGains {
  double proportional_a_per_wb;
  double integral_a_per_wbs;

  static constexpr std::tuple kGains{
      gain("proportional_a_per_wb", &FluxGains::proportional_a_per_wb, GainRule::kNotNegative),
      gain("integral_a_per_wbs", &FluxGains::integral_a_per_wbs, GainRule::kNotNegative)};
};

}  // namespace drivebench::control
