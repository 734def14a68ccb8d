#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"

namespace drivebench::control {

/// Gains on ∫e, e, the speed error and the current error. The loop's polynomial is s⁴ + (R/L + K3 + f/J)·s³ +
/// ((R/L + K3)·f/J + (K_T/J)·(K_b/L + K2))·s² + (K_T/J)·K1·s + (K_T/J)·K0.
struct DcVoltageGains {
  double integral_a_per_rad_s2;     ///< K0 [A/(rad·s²)]
  double proportional_a_per_rad_s;  ///< K1 [A/(rad·s)]
  double derivative_a_per_rad;      ///< K2 [A/rad]
  double current_per_s;             ///< K3

  static constexpr DcVoltageGains placed(const Polynomial<4>& poles, const DcMachineModel& m) noexcept {
    const double friction = m.friction_rate_per_s();
    const double per_a = m.acceleration_per_a();
    const double electrical = poles[0] - friction;  // R/L + K3
    return {.integral_a_per_rad_s2 = poles[3] / per_a,
            .proportional_a_per_rad_s = poles[2] / per_a,
            .derivative_a_per_rad =
                (poles[1] - electrical * friction) / per_a - m.torque_constant_nm_per_a / m.inductance_h,
            .current_per_s = electrical - m.resistance_ohm / m.inductance_h};
  }

  static constexpr std::tuple kGains{
      gain("integral_a_per_rad_s2", &DcVoltageGains::integral_a_per_rad_s2),
      gain("proportional_a_per_rad_s", &DcVoltageGains::proportional_a_per_rad_s),
      gain("derivative_a_per_rad", &DcVoltageGains::derivative_a_per_rad),
      gain("current_per_s", &DcVoltageGains::current_per_s)};
};

struct DcVoltageFeedbackParameters {
  DcAxisParameters axis;
  DcVoltageGains position;

  static constexpr std::tuple kGains{gains_in("", &DcVoltageFeedbackParameters::axis),
                                     gains_in("position.", &DcVoltageFeedbackParameters::position)};
  std::vector<std::string> problems() const;
};

/// State feedback straight to the voltage of the armature, without a current loop:
///   v = v_ref + L·(K0·∫e + K1·e + K2·(ω_ref − ω̂) + K3·(i_ref − i))        with e = θ_ref − θ
/// Under a constant load e goes to 0 and the current error to −τ_L/K_T. Source: the book, problem 2.23
/// (CTL-03).
class DcVoltageFeedback final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcVoltageFeedback(const DcVoltageFeedbackParameters& p) noexcept;

 private:
  double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept override;
  void integrate(double excess) noexcept override;

  DcMachineModel machine_;
  DcVoltageGains gains_;
  double error_rad_ = 0.0;
  double error_integral_rad_s_ = 0.0;
};

}  // namespace drivebench::control
