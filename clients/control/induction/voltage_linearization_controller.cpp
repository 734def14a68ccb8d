#include "clients/control/induction/voltage_linearization_controller.hpp"

#include <utility>

#include "clients/control/induction/induction_drive.hpp"

namespace drivebench::control {

VoltageLinearizationController::VoltageLinearizationController(
    const InductionDriveParameters& drive, const VoltageLinearizationParameters& p,
    const FluxReferenceParameters& flux, std::shared_ptr<const OptimumTorqueTable> optimum) noexcept
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "flux_wb", "flux_ref_wb", "flux_angle_rad"}),
      drive_(drive),
      p_(p),
      feedback_(drive),
      flux_reference_(flux, drive.motor.machine, drive.period_s(), std::move(optimum)) {}

Setpoint VoltageLinearizationController::step(const Measurement& m, const Reference& r,
                                              std::int64_t periods) noexcept {
  const InductionMachineModel& machine = drive_.motor.machine;
  const InductionState& x = feedback_.sample(m, periods);
  const FluxTarget target = flux_reference_.step(r, periods);
  const double flux_gain = machine.flux_decay_per_s() * machine.mutual_inductance_h;  // η·M
  const double mu = machine.acceleration_per_wb_a();
  const double flux_rate_wb_s = flux_gain * x.current_a.d - machine.flux_decay_per_s() * x.flux_wb;
  const double motor_rad_s2 = mu * x.flux_wb * x.current_a.q;

  const double flux_error_wb = target.flux_wb - x.flux_wb;
  const double w_d = p_.flux_integral_per_s3 * flux_integral_wb_s_ +
                     p_.flux_proportional_per_s2 * flux_error_wb +
                     p_.flux_derivative_per_s * (target.rate_wb_s - flux_rate_wb_s);
  const double angle_error_rad = r.angle_rad - x.angle_rad;
  const double friction_per_s = machine.friction_rate_per_s();
  const double motor_ref_rad_s2 = r.acceleration_rad_s2 + friction_per_s * r.speed_rad_s;
  const double w_q = p_.position_integral_per_s4 * angle_integral_rad_s_ +
                     p_.position_proportional_per_s3 * angle_error_rad +
                     p_.position_derivative_per_s2 * (r.speed_rad_s - x.speed_rad_s) +
                     p_.acceleration_per_s * (motor_ref_rad_s2 - motor_rad_s2) + r.jerk_rad_s3 +
                     friction_per_s * r.acceleration_rad_s2;

  const double psi = x.flux_divisor_wb();
  const Dq voltage_v =
      decoupled_voltage_v(drive_.motor, x,
                          {.d = flux_rate_wb_s / machine.mutual_inductance_h + w_d / flux_gain,
                           .q = -flux_rate_wb_s * x.current_a.q / psi + w_q / (mu * psi)});
  const PhaseVoltages command = held_voltage(drive_, x, voltage_v);
  if (!command.saturated) {
    flux_integral_wb_s_ += drive_.period_s() * flux_error_wb;
    angle_integral_rad_s_ += drive_.period_s() * angle_error_rad;
  }
  tell({.angle_rad = x.angle_rad, .speed_rad_s = x.speed_rad_s, .saturated = command.saturated},
       {x.current_a.d, x.current_a.q, x.flux_wb, target.flux_wb, x.flux_angle_rad});
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
}

}  // namespace drivebench::control
