#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"
#include "clients/control/gains/loop_gains.hpp"

namespace drivebench::control {

struct DcStateFeedbackParameters {
  DcAxisParameters axis;
  ServoGains position;  ///< as accelerations; the friction f/J stays in the loop

  static constexpr std::tuple kGains{gains_in("", &DcStateFeedbackParameters::axis),
                                     gains_in("position.", &DcStateFeedbackParameters::position)};
  std::vector<std::string> problems() const { return dc_problems(*this); }
};

/// Tracking of a position with the reference's own current in front:
///   i_r = i_ref + (J/K_T)·(K0·∫e + K1·e + K2·(ω_ref − ω̂))        with e = θ_ref − θ
/// A constant load leaves nothing with the integral and e = τ_L/(J·K1) without. Source: the book, 2.6
/// (CTL-01, CTL-02).
class DcStateFeedback final : public DcController {
 public:
  /// `p` must have no problems().
  explicit DcStateFeedback(const DcStateFeedbackParameters& p) noexcept;

 private:
  double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept override;
  void integrate(double excess) noexcept override;

  DcMachineModel machine_;
  ServoGains gains_;
  double error_rad_ = 0.0;
  double error_integral_rad_s_ = 0.0;
};

}  // namespace drivebench::control
