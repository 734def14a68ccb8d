#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"

namespace drivebench::control {

struct DcSpeedLoopParameters {
  DcAxisParameters axis;
  double proportional_as_per_rad;  ///< K

  static constexpr std::tuple kGains{
      gains_in("", &DcSpeedLoopParameters::axis),
      gain("speed.proportional_as_per_rad", &DcSpeedLoopParameters::proportional_as_per_rad,
           GainRule::kNotNegative)};
  std::vector<std::string> problems() const { return dc_problems(*this); }
};

/// i_r = K·(ω_ref − ω̂). A constant speed ω_0 is missed by f·ω_0/(f + K·K_T). Source: the book, 2.3
/// (SPD-01).
class DcSpeedLoop final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcSpeedLoop(const DcSpeedLoopParameters& p) noexcept
      : DcController(p.axis, Law::kCurrent), proportional_as_per_rad_(p.proportional_as_per_rad) {}

 private:
  double wanted(const Reference& r, const ShaftEstimate& shaft, double) noexcept override {
    return proportional_as_per_rad_ * (r.speed_rad_s - shaft.speed_rad_s);
  }
  void integrate(double) noexcept override {}

  double proportional_as_per_rad_;
};

}  // namespace drivebench::control
