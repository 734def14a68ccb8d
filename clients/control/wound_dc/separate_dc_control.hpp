#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/wound_dc/wound_dc_controller.hpp"

namespace drivebench::control {

/// λ_ref = λ_0 up to the base speed and λ_0·ω_base/|ω| above, so that the back-emf stays. Source: the book,
/// 1.7 (DC-07).
struct FieldWeakening {
  double rated_flux_wb;  ///< λ_0
  double base_speed_rad_s;

  struct Flux {
    double flux_wb;
    double slope_wb_per_s;
  };
  Flux at(const Reference& r) const noexcept;

  static constexpr std::tuple kGains{
      gain("rated_wb", &FieldWeakening::rated_flux_wb, GainRule::kPositive),
      gain("base_speed_rad_s", &FieldWeakening::base_speed_rad_s, GainRule::kPositive)};
};

struct SeparateDcParameters {
  WoundDcAxisParameters axis;
  FieldWeakening flux;
  double flux_per_s;  ///< K_f: how fast the flux comes to its reference
  ServoGains speed;   ///< on ∫e, e and the acceleration error of the speed

  static constexpr std::tuple kGains{
      gains_in("", &SeparateDcParameters::axis), gains_in("flux.", &SeparateDcParameters::flux),
      gain("flux.proportional_per_s", &SeparateDcParameters::flux_per_s, GainRule::kPositive),
      gains_in("speed.", &SeparateDcParameters::speed)};
  std::vector<std::string> problems() const;
};

/// Armature and field of a separately excited machine, made linear: with z1 = ω, z2 = dω/dt without a load,
/// z3 = λ_f,
///   u_f = R_f·i_f + K_f·(λ_ref − λ_f) + dλ_ref/dt
///   u = R·i + K_m·λ_f·ω + (L/λ_f)·((J/K_m)·(v1 + (f/J)·z2) − λ_f'·i)        so that dz2/dt = v1
///   v1 = K0·∫(ω_ref − ω) + K1·(ω_ref − ω) + K2·(α_ref − z2) + jerk
/// λ_f' is the one that the field voltage gives within its limit. Singular without flux. With friction, which
/// the book omits. Source: the book, problem 2.40 (CTL-08).
class SeparateDcController final : public WoundDcController {
 public:
  /// `p` must have no problems().
  explicit SeparateDcController(const SeparateDcParameters& p) noexcept
      : WoundDcController(p.axis, FieldConnection::kSeparate), p_(p) {}

 private:
  Setpoint voltages(const Reference& r, const WoundDcState& x) noexcept override;
  void integrate(const Setpoint& excess_v) noexcept override;

  SeparateDcParameters p_;
  double speed_error_rad_s_ = 0.0;
  double speed_integral_rad_ = 0.0;
};

struct FieldControlDcParameters {
  WoundDcAxisParameters axis;
  double armature_voltage_v;  ///< V_a0, constant above the start
  double rated_flux_wb;       ///< during the start
  double start_speed_rad_s;   ///< of the reference: below it the armature voltage rises with the reference
  double energy_integral_per_s4;      ///< K0
  double energy_proportional_per_s3;  ///< K1
  double power_per_s2;                ///< K2
  double power_slope_per_s;           ///< K3

  static constexpr std::tuple kGains{
      gains_in("", &FieldControlDcParameters::axis),
      gain("armature_voltage_v", &FieldControlDcParameters::armature_voltage_v, GainRule::kPositive),
      gain("flux.rated_wb", &FieldControlDcParameters::rated_flux_wb, GainRule::kPositive),
      gain("start_speed_rad_s", &FieldControlDcParameters::start_speed_rad_s, GainRule::kPositive),
      gain("energy.integral_per_s4", &FieldControlDcParameters::energy_integral_per_s4),
      gain("energy.proportional_per_s3", &FieldControlDcParameters::energy_proportional_per_s3),
      gain("energy.power_per_s2", &FieldControlDcParameters::power_per_s2),
      gain("energy.power_slope_per_s", &FieldControlDcParameters::power_slope_per_s)};
  std::vector<std::string> problems() const;
};

/// Speed by the field alone, the armature at constant voltage: the energy z1 = (L·i² + J·ω²)/2 has the
/// derivatives z2 = −R·i² + i·V_a0 and z3 = (V_a0 − 2R·i)·(V_a0 − R·i − K_m·λ_f·ω)/L, and λ_f' enters dz3/dt:
///   λ_f' = −(L·(v + 2R·i'²)/(V_a0 − 2R·i) + R·i' + K_m·λ_f·ω')/(K_m·ω)        so that dz3/dt = v
///   v = K0·∫e1 + K1·e1 + K2·e2 + K3·e3        with e = z_ref − z, z1_ref = J·ω_ref²/2 and its derivatives
/// A load, and friction, enter dz1/dt as −ω·τ_L alone: the integral takes them. Singular at ω = 0 and i =
/// V_a0/(2R), so it starts with full field and an armature voltage that rises with the reference. Source:
/// the book, problem 2.41 (CTL-09); its first two equations are misprinted.
class FieldControlDcController final : public WoundDcController {
 public:
  /// `p` must have no problems().
  explicit FieldControlDcController(const FieldControlDcParameters& p) noexcept
      : WoundDcController(p.axis, FieldConnection::kSeparate), p_(p) {}

 private:
  Setpoint voltages(const Reference& r, const WoundDcState& x) noexcept override;
  void integrate(const Setpoint& excess_v) noexcept override;
  double flux_slope(const Reference& r, const WoundDcState& x) noexcept;

  FieldControlDcParameters p_;
  bool running_ = false;
  double energy_error_j_ = 0.0;
  double energy_integral_js_ = 0.0;
};

}  // namespace drivebench::control
