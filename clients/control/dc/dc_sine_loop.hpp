#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"
#include "clients/control/math/small_matrix.hpp"

namespace drivebench::control {

/// K·(s + a)/(s² + ω_0²).
struct DcSineGains {
  double gain_a_s_per_rad;         ///< K [A·s/rad], may be negative
  double zero_per_s;               ///< a, may be negative
  double angular_frequency_rad_s;  ///< ω_0

  static constexpr std::tuple kGains{
      gain("gain_a_s_per_rad", &DcSineGains::gain_a_s_per_rad), gain("zero_per_s", &DcSineGains::zero_per_s),
      gain("angular_frequency_rad_s", &DcSineGains::angular_frequency_rad_s, GainRule::kPositive)};
};

struct DcSineLoopParameters {
  DcAxisParameters axis;
  DcSineGains loop;

  static constexpr std::tuple kGains{gains_in("", &DcSineLoopParameters::axis),
                                     gains_in("loop.", &DcSineLoopParameters::loop)};
  /// The loop's polynomial is s·(s + f/J)·(s² + ω_0²) + K·(K_T/J)·(s + a).
  std::vector<std::string> problems() const;
};

/// Follows a sine of known frequency without error because the compensator can make that sine by itself
/// (internal model): i_r = K·(a·x1 + x2), dx1/dt = x2, dx2/dt = −ω_0²·x1 + e, solved exactly for a held
/// error. Source: the book, appendix of chapter 2 (CTL-07).
class DcSineLoop final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcSineLoop(const DcSineLoopParameters& p) noexcept;

 private:
  double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept override;
  void integrate(double excess) noexcept override;

  DcSineGains gains_;
  Matrix<3, 3> over_period_;  // of (x1, x2, e)
  double error_rad_ = 0.0;
  double x1_ = 0.0;
  double x2_ = 0.0;
};

}  // namespace drivebench::control
