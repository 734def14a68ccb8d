#pragma once

#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/induction/flux_reference.hpp"
#include "clients/control/induction/induction_drive.hpp"
#include "clients/control/loop/controller.hpp"

namespace drivebench::control {

/// Gains of the two linear loops that voltage linearisation leaves; see below. placed() puts both at four and
/// three real poles −r.
struct VoltageLinearizationParameters {
  double position_integral_per_s4;      ///< K0
  double position_proportional_per_s3;  ///< K1
  double position_derivative_per_s2;    ///< K2
  double acceleration_per_s;            ///< K3
  double flux_integral_per_s3;          ///< G0
  double flux_proportional_per_s2;      ///< G1
  double flux_derivative_per_s;         ///< G2

  static constexpr std::tuple kGains{
      gain("position.integral_per_s4", &VoltageLinearizationParameters::position_integral_per_s4,
           GainRule::kNotNegative),
      gain("position.proportional_per_s3", &VoltageLinearizationParameters::position_proportional_per_s3,
           GainRule::kNotNegative),
      gain("position.derivative_per_s2", &VoltageLinearizationParameters::position_derivative_per_s2,
           GainRule::kNotNegative),
      gain("acceleration.proportional_per_s", &VoltageLinearizationParameters::acceleration_per_s,
           GainRule::kNotNegative),
      gain("flux.integral_per_s3", &VoltageLinearizationParameters::flux_integral_per_s3,
           GainRule::kNotNegative),
      gain("flux.proportional_per_s2", &VoltageLinearizationParameters::flux_proportional_per_s2,
           GainRule::kNotNegative),
      gain("flux.derivative_per_s", &VoltageLinearizationParameters::flux_derivative_per_s,
           GainRule::kNotNegative)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  /// (s + r)⁴ and (s + g)³, with the friction rate f/J in the loop.
  static constexpr VoltageLinearizationParameters placed(double r_per_s, double g_per_s,
                                                         double friction_rate_per_s) noexcept {
    const double k3 = 4.0 * r_per_s - friction_rate_per_s;
    return {.position_integral_per_s4 = r_per_s * r_per_s * r_per_s * r_per_s,
            .position_proportional_per_s3 = 4.0 * r_per_s * r_per_s * r_per_s,
            .position_derivative_per_s2 = 6.0 * r_per_s * r_per_s - k3 * friction_rate_per_s,
            .acceleration_per_s = k3,
            .flux_integral_per_s3 = g_per_s * g_per_s * g_per_s,
            .flux_proportional_per_s2 = 3.0 * g_per_s * g_per_s,
            .flux_derivative_per_s = 3.0 * g_per_s};
  }
};

/// Position control of an induction machine by input-output linearisation with voltage command. The motor's
/// acceleration α = μ·ψ·i_q and ψ' = η·M·i_d − η·ψ are states, and
///   di_d/dt = ψ'/M + w_d/(η·M)        di_q/dt = −ψ'·i_q/ψ + w_q/(μ·ψ)
/// makes ψ'' = w_d and α' = w_q, which are then
///   w_d = G0·∫e_ψ + G1·e_ψ + G2·(ψ_ref' − ψ')
///   w_q = K0·∫e + K1·e + K2·(ω_ref − ω̂) + K3·(α_m,ref − α) + dα_m,ref/dt
/// with α_m,ref = α_ref + (f/J)·ω_ref. No current loop, so no current limit: peak currents follow from the
/// references. Voltages are turned half a period ahead, since they are held while the flux moves on. A phase
/// at its limit freezes both integrators. Singular at ψ = 0: below 1e-3 Wb it is taken for 1e-3 Wb. Source:
/// (8.33) (IMC-06); the print of dρ/dt there lacks μ in the denominator.
class VoltageLinearizationController final : public Controller {
 public:
  /// No parameter set may have problems().
  VoltageLinearizationController(const InductionDriveParameters& drive,
                                 const VoltageLinearizationParameters& p, const FluxReferenceParameters& flux,
                                 std::shared_ptr<const OptimumTorqueTable> optimum = nullptr) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;

  InductionDriveParameters drive_;
  VoltageLinearizationParameters p_;
  InductionFeedback feedback_;
  FluxReference flux_reference_;
  double angle_integral_rad_s_ = 0.0;
  double flux_integral_wb_s_ = 0.0;
};

}  // namespace drivebench::control
