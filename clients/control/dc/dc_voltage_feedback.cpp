#include "clients/control/dc/dc_voltage_feedback.hpp"

#include <span>
#include <string>
#include <vector>

#include "clients/control/dc/dc_references.hpp"

namespace drivebench::control {

std::vector<std::string> DcVoltageFeedbackParameters::problems() const {
  std::vector<std::string> found = dc_problems(*this);
  const DcMachineModel& m = axis.machine;
  const double electrical = m.resistance_ohm / m.inductance_h + position.current_per_s;
  const double friction = m.friction_rate_per_s();
  const double per_a = m.acceleration_per_a();
  // Without an integral its root at 0 is no instability.
  const Polynomial<4> loop = {
      electrical + friction,
      electrical * friction +
          per_a * (m.torque_constant_nm_per_a / m.inductance_h + position.derivative_a_per_rad),
      per_a * position.proportional_a_per_rad_s, per_a * position.integral_a_per_rad_s2};
  const std::size_t order = position.integral_a_per_rad_s2 == 0.0 ? 3 : 4;
  if (found.empty() && !is_hurwitz(std::span(loop).first(order)))
    found.emplace_back("position.integral_a_per_rad_s2 and the gains beside it make the loop unstable");
  return found;
}

DcVoltageFeedback::DcVoltageFeedback(const DcVoltageFeedbackParameters& p) noexcept
    : DcController(p.axis, Law::kVoltage), machine_(p.axis.machine), gains_(p.position) {}

double DcVoltageFeedback::wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept {
  error_rad_ = r.angle_rad - shaft.angle_rad;
  const double feedback_a_per_s = gains_.integral_a_per_rad_s2 * error_integral_rad_s_ +
                                  gains_.proportional_a_per_rad_s * error_rad_ +
                                  gains_.derivative_a_per_rad * (r.speed_rad_s - shaft.speed_rad_s) +
                                  gains_.current_per_s * (reference_current_a(machine_, r) - armature_a);
  return reference_voltage_v(machine_, r) + machine_.inductance_h * feedback_a_per_s;
}

void DcVoltageFeedback::integrate(double excess) noexcept {
  error_integral_rad_s_ = integrated(error_integral_rad_s_, error_rad_, excess);
}

}  // namespace drivebench::control
