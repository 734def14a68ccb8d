#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"

namespace drivebench::control {

/// Position loop around a speed loop. With K_wI = 0 the polynomial is s³ + (f/J + K_wP·k)·s² + K_thP·K_wP·k·s
/// + K_thI·K_wP·k with k = K_T/J.
struct DcNestedGains {
  double angle_proportional_per_s;        ///< K_thP
  double angle_integral_per_s2;           ///< K_thI
  double speed_proportional_as_per_rad;   ///< K_wP
  double speed_integral_a_per_rad = 0.0;  ///< K_wI

  /// For K_wI = 0.
  static constexpr DcNestedGains placed(const Polynomial<3>& poles, const DcMachineModel& m) noexcept {
    const double speed_per_s = poles[0] - m.friction_rate_per_s();  // K_wP·k
    return {.angle_proportional_per_s = poles[1] / speed_per_s,
            .angle_integral_per_s2 = poles[2] / speed_per_s,
            .speed_proportional_as_per_rad = speed_per_s / m.acceleration_per_a()};
  }

  static constexpr std::tuple kGains{
      gain("angle.proportional_per_s", &DcNestedGains::angle_proportional_per_s, GainRule::kNotNegative),
      gain("angle.integral_per_s2", &DcNestedGains::angle_integral_per_s2, GainRule::kNotNegative),
      gain("speed.proportional_as_per_rad", &DcNestedGains::speed_proportional_as_per_rad,
           GainRule::kPositive),
      gain("speed.integral_a_per_rad", &DcNestedGains::speed_integral_a_per_rad, GainRule::kNotNegative)};
};

struct DcNestedLoopsParameters {
  DcAxisParameters axis;
  DcNestedGains loops;

  static constexpr std::tuple kGains{gains_in("", &DcNestedLoopsParameters::axis),
                                     gains_in("", &DcNestedLoopsParameters::loops)};
  std::vector<std::string> problems() const;
};

/// Nested loops with nothing of the reference but its angle:
///   ω_want = K_thP·e + K_thI·∫e        i_r = K_wP·(ω_want − ω̂) + K_wI·∫(ω_want − ω̂)
/// A constant acceleration a is always missed: by a·(f/J + K_wP·k)/(K_thI·K_wP·k) with K_wI = 0, else by
/// a/K_thI. With DcDrive::kOwnRegulator the current loop is the third (CTL-05).
/// Source: the book, 2.7 (CTL-04, CTL-05).
class DcNestedLoops final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcNestedLoops(const DcNestedLoopsParameters& p) noexcept
      : DcController(p.axis, Law::kCurrent), gains_(p.loops) {}

 private:
  double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept override;
  void integrate(double excess) noexcept override;

  DcNestedGains gains_;
  double angle_error_rad_ = 0.0;
  double angle_integral_rad_s_ = 0.0;
  double speed_error_rad_s_ = 0.0;
  double speed_integral_rad_ = 0.0;
};

}  // namespace drivebench::control
