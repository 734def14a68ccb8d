#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"

namespace drivebench::control {

/// For a shaft with the polynomial s·(s + f/J): s³ + (f/J + K_t·k)·s² + K·k·s + a·K·k, k = K_T/J.
struct DcTachometerGains {
  double proportional_a_per_rad;  ///< K
  double zero_per_s;              ///< a of K·(s + a)/s; 0: no integral
  double speed_as_per_rad;        ///< K_t

  static constexpr DcTachometerGains placed(const Polynomial<3>& poles, const DcMachineModel& m) noexcept {
    const double k = m.acceleration_per_a();
    return {.proportional_a_per_rad = poles[1] / k,
            .zero_per_s = poles[2] / poles[1],
            .speed_as_per_rad = (poles[0] - m.friction_rate_per_s()) / k};
  }

  static constexpr std::tuple kGains{
      gain("proportional_a_per_rad", &DcTachometerGains::proportional_a_per_rad, GainRule::kPositive),
      gain("zero_per_s", &DcTachometerGains::zero_per_s, GainRule::kNotNegative),
      gain("speed_as_per_rad", &DcTachometerGains::speed_as_per_rad, GainRule::kNotNegative)};
};

struct DcTachometerLoopParameters {
  DcAxisParameters axis;
  DcTachometerGains loop;

  static constexpr std::tuple kGains{gains_in("", &DcTachometerLoopParameters::axis),
                                     gains_in("loop.", &DcTachometerLoopParameters::loop)};
  std::vector<std::string> problems() const;
};

/// The classical position loop: PI on the angle error, and the speed, usually of a tachometer, fed back by
/// itself and not as the derivative of the error:
///   i_r = K·(e + a·∫e) − K_t·ω
/// A step of the reference asks for K amperes per radian at once. Source: the book, appendix of chapter
/// 2 (CTL-06).
class DcTachometerLoop final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcTachometerLoop(const DcTachometerLoopParameters& p) noexcept
      : DcController(p.axis, Law::kCurrent), gains_(p.loop) {}

 private:
  double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept override;
  void integrate(double excess) noexcept override;

  DcTachometerGains gains_;
  double error_rad_ = 0.0;
  double error_integral_rad_s_ = 0.0;
};

}  // namespace drivebench::control
