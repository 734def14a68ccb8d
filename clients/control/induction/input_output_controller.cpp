#include "clients/control/induction/input_output_controller.hpp"

#include <utility>

namespace drivebench::control {

InputOutputController::InputOutputController(const InductionDriveParameters& drive,
                                             const InputOutputParameters& p,
                                             const FluxReferenceParameters& flux,
                                             std::shared_ptr<const OptimumTorqueTable> optimum) noexcept
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_ref_wb",
                                      "flux_angle_rad", "references_clipped"}),
      drive_(drive),
      p_(p),
      feedback_(drive),
      flux_reference_(flux, drive.motor.machine, drive.period_s(), std::move(optimum)),
      current_loop_(p.current, drive.voltage_limit_v, drive.period_s()) {}

Setpoint InputOutputController::step(const Measurement& m, const Reference& r,
                                     std::int64_t periods) noexcept {
  const InductionMachineModel& machine = drive_.motor.machine;
  const InductionState& x = feedback_.sample(m, periods);
  const FluxTarget target = flux_reference_.step(r, periods);

  const double flux_error_wb = target.flux_wb - x.flux_wb;
  bool direct_clipped = false;
  const double i_d_ref_a = clipped(p_.flux.proportional_a_per_wb * flux_error_wb +
                                       p_.flux.integral_a_per_wbs * flux_integral_wb_s_ + target.i_d_a,
                                   drive_.direct_reference_limit_a(), direct_clipped);

  const double angle_error_rad = r.angle_rad - x.angle_rad;
  const double motor_rad_s2 = p_.position.integral_per_s3 * angle_integral_rad_s_ +
                              p_.position.proportional_per_s2 * angle_error_rad +
                              p_.position.derivative_per_s * (r.speed_rad_s - x.speed_rad_s) +
                              r.acceleration_rad_s2 + machine.friction_rate_per_s() * x.speed_rad_s;
  const double divisor_wb =
      p_.divisor == TorqueDivisor::kEstimatedFlux ? x.flux_divisor_wb() : target.flux_wb;
  bool quadrature_clipped = false;
  const double i_q_ref_a = clipped(motor_rad_s2 / (machine.acceleration_per_wb_a() * divisor_wb),
                                   drive_.quadrature_reference_limit_a, quadrature_clipped);

  const PhaseVoltages command =
      current_loop_.step({.d = i_d_ref_a - x.current_a.d, .q = i_q_ref_a - x.current_a.q}, x.flux);
  if (!command.saturated && !direct_clipped) flux_integral_wb_s_ += drive_.period_s() * flux_error_wb;
  if (!command.saturated && !quadrature_clipped) angle_integral_rad_s_ += drive_.period_s() * angle_error_rad;
  tell({.angle_rad = x.angle_rad, .speed_rad_s = x.speed_rad_s, .saturated = command.saturated},
       {x.current_a.d, x.current_a.q, i_d_ref_a, i_q_ref_a, x.flux_wb, target.flux_wb, x.flux_angle_rad,
        direct_clipped || quadrature_clipped ? 1.0 : 0.0});
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
}

}  // namespace drivebench::control
