#include "clients/control/dc/dc_state_feedback.hpp"

#include "clients/control/dc/dc_references.hpp"

namespace drivebench::control {

DcStateFeedback::DcStateFeedback(const DcStateFeedbackParameters& p) noexcept
    : DcController(p.axis, Law::kCurrent), machine_(p.axis.machine), gains_(p.position) {}

double DcStateFeedback::wanted(const Reference& r, const ShaftEstimate& shaft, double) noexcept {
  error_rad_ = r.angle_rad - shaft.angle_rad;
  const double feedback_rad_s2 = gains_.integral_per_s3 * error_integral_rad_s_ +
                                 gains_.proportional_per_s2 * error_rad_ +
                                 gains_.derivative_per_s * (r.speed_rad_s - shaft.speed_rad_s);
  return reference_current_a(machine_, r) + feedback_rad_s2 / machine_.acceleration_per_a();
}

void DcStateFeedback::integrate(double excess) noexcept {
  error_integral_rad_s_ = integrated(error_integral_rad_s_, error_rad_, excess);
}

}  // namespace drivebench::control
