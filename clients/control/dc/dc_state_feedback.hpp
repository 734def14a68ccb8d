#pragma once

#include "clients/control/dc/dc_controller.hpp"

namespace drivebench::control {

/// Gains on ∫e, e and the speed error, as accelerations. The loop's polynomial is s³ + (K2 + f/J)·s² + K1·s +
/// K0, without an integral s² + (K2 + f/J)·s + K1.
struct DcStateGains {
  double integral_per_s3;      ///< K0; 0: no integral (CTL-02)
  double proportional_per_s2;  ///< K1
  double derivative_per_s;     ///< K2

  static constexpr DcStateGains placed(const Polynomial<3>& poles, double friction_rate_per_s) noexcept {
    return {.integral_per_s3 = poles[2],
            .proportional_per_s2 = poles[1],
            .derivative_per_s = poles[0] - friction_rate_per_s};
  }
  static constexpr DcStateGains placed(const Polynomial<2>& poles, double friction_rate_per_s) noexcept {
    return {.integral_per_s3 = 0.0,
            .proportional_per_s2 = poles[1],
            .derivative_per_s = poles[0] - friction_rate_per_s};
  }
};

struct DcStateFeedbackParameters {
  DcAxisParameters axis;
  DcStateGains position;

  static std::span<const GainRow<DcStateFeedbackParameters>> gains() noexcept;
  std::vector<std::string> problems() const { return dc_problems(*this); }
};

/// Tracking of a position with the reference's own current in front:
///   i_r = i_ref + (J/K_T)·(K0·∫e + K1·e + K2·(ω_ref − ω̂))        with e = θ_ref − θ
/// A constant load leaves nothing with the integral and e = τ_L/(J·K1) without. Source: Chiasson 2005, 2.6
/// (CTL-01, CTL-02).
class DcStateFeedback final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcStateFeedback(const DcStateFeedbackParameters& p) noexcept;

 private:
  double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept override;
  void integrate(double excess) noexcept override;

  DcMachineModel machine_;
  DcStateGains gains_;
  double error_rad_ = 0.0;
  double error_integral_rad_s_ = 0.0;
};

}  // namespace drivebench::control
