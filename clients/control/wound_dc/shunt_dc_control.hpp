#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/wound_dc/wound_dc_controller.hpp"

namespace drivebench::control {

struct ShuntDcParameters {
  WoundDcAxisParameters axis;
  double speed_proportional_per_s;  ///< K1
  double speed_integral_per_s2;     ///< K0

  static constexpr std::tuple kGains{
      gains_in("", &ShuntDcParameters::axis),
      gain("speed.proportional_per_s", &ShuntDcParameters::speed_proportional_per_s, GainRule::kPositive),
      gain("speed.integral_per_s2", &ShuntDcParameters::speed_integral_per_s2, GainRule::kPositive)};
  std::vector<std::string> problems() const;
};

/// Speed of a shunt machine by input and output, the armature's inductance neglected:
///   u = K_m·λ_f·ω + v1·J·R/(K_m·λ_f)        makes dω/dt = v1 − τ_L/J
///   v1 = α_ref + K1·(ω_ref − ω) + K0·∫(ω_ref − ω)
/// The rest, ½·d(λ_f²)/dt = −(R_F/L_f − K_m·ω)·λ_f² + (J·R/K_m)·v1, is bounded below ω = R_F/(K_m·L_f)
/// only (with the resistance of the field: the book prints the armature's). Source: the book,
/// problem 2.47 (CTL-13).
class ShuntDcController final : public WoundDcController {
 public:
  /// `p` must have no problems().
  explicit ShuntDcController(const ShuntDcParameters& p) noexcept
      : WoundDcController(p.axis, FieldConnection::kShunt), p_(p) {}

 private:
  Setpoint voltages(const Reference& r, const WoundDcState& x) noexcept override;
  void integrate(const Setpoint& excess_v) noexcept override;

  ShuntDcParameters p_;
  double speed_error_rad_s_ = 0.0;
  double speed_integral_rad_ = 0.0;
};

/// The reduced shunt machine in the coordinates of its exact linearisation, unsaturated:
///   z1 = ω − K_m·λ_f²/(2·J·R)        z2 = (K_m·λ_f²/(J·R))·(R_F/L_f − K_m·ω)
///   dz1/dt = z2 − τ_L/J        dz2/dt = α + β·u + (K_m²/(J·R))·λ_f²·τ_L/J
struct ShuntDcChain {
  double z1_rad_s;
  double z2_rad_s2;
  double alpha_rad_s3;
  double beta_rad_s3_per_v;
  double load_gain_per_s;  ///< factor of τ_L/J in dz2/dt

  static ShuntDcChain at(const WoundDcModel& m, double flux_wb, double speed_rad_s) noexcept;
  /// λ_f that holds a speed against a load: the speed must be below R_F/(K_m·L_f).
  static double holding_flux_wb(const WoundDcModel& m, double speed_rad_s, double load_nm) noexcept;
};

struct ExactShuntDcParameters {
  WoundDcAxisParameters axis;
  double start_per_s;                ///< of the input-output law where β is not safe
  double chain_proportional_per_s2;  ///< K1
  double chain_derivative_per_s;     ///< K2
  double least_beta_rad_s3_per_v;

  static constexpr std::tuple kGains{
      gains_in("", &ExactShuntDcParameters::axis),
      gain("start_per_s", &ExactShuntDcParameters::start_per_s, GainRule::kPositive),
      gain("chain.proportional_per_s2", &ExactShuntDcParameters::chain_proportional_per_s2,
           GainRule::kPositive),
      gain("chain.derivative_per_s", &ExactShuntDcParameters::chain_derivative_per_s, GainRule::kPositive),
      gain("least_beta_rad_s3_per_v", &ExactShuntDcParameters::least_beta_rad_s3_per_v, GainRule::kPositive)};
  std::vector<std::string> problems() const;
};

/// Both states of the reduced shunt machine made linear: dz2/dt = K1·(z1_ref − z1) + K2·(z2_ref − z2), with
/// the references that belong to ω_ref under the present load, of friction and of the load observer. Singular
/// where β = 0: at rest, and where 2R_F/L_f − 2K_m·ω = K_m²·λ_f²/(J·R); there the input-output law stands in.
/// Unloaded there is no flux to hold any speed but R_F/(K_m·L_f). Source: the book, problem 2.46
/// (CTL-12).
class ExactShuntDcController final : public WoundDcController {
 public:
  /// `p` must have no problems().
  explicit ExactShuntDcController(const ExactShuntDcParameters& p) noexcept
      : WoundDcController(p.axis, FieldConnection::kShunt), p_(p) {}

 private:
  Setpoint voltages(const Reference& r, const WoundDcState& x) noexcept override;
  void integrate(const Setpoint&) noexcept override {}

  ExactShuntDcParameters p_;
};

}  // namespace drivebench::control
