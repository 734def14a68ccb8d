#include "clients/control/induction/input_output_controller.hpp"

#include <utility>

#include "clients/control/gains/gain_rows.hpp"

namespace drivebench::control {

std::span<const GainRow<InputOutputParameters>> InputOutputParameters::gains() noexcept {
  using P = InputOutputParameters;
  static constexpr auto kRows = joined(current_rows<P>(), position_rows<P>(), flux_rows<P>());
  return kRows;
}

std::vector<std::string> InputOutputParameters::problems() const {
  return range_problems(*this);
}

InputOutputController::InputOutputController(const InductionDriveParameters& drive,
                                             const InputOutputParameters& p,
                                             const FluxReferenceParameters& flux,
                                             std::shared_ptr<const OptimumTorqueTable> optimum) noexcept
    : drive_(drive),
      p_(p),
      feedback_(drive),
      flux_reference_(flux, drive.motor.machine, drive.period_s(), std::move(optimum)),
      current_loop_(p.current, drive.voltage_limit_v, drive.period_s()) {}

std::span<const std::string_view> InputOutputController::telemetry_names() const noexcept {
  static constexpr auto kNames =
      std::to_array<std::string_view>({"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_ref_wb",
                                       "flux_angle_rad", "references_clipped"});
  return kNames;
}

Setpoint InputOutputController::update(const Measurement& m, const Reference& r,
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

  const PhaseCommand command =
      current_loop_.step({.d = i_d_ref_a - x.current_a.d, .q = i_q_ref_a - x.current_a.q}, x.flux);
  saturated_ = command.saturated;
  if (!saturated_ && !direct_clipped) flux_integral_wb_s_ += drive_.period_s() * flux_error_wb;
  if (!saturated_ && !quadrature_clipped) angle_integral_rad_s_ += drive_.period_s() * angle_error_rad;
  telemetry_ = {
      x.current_a.d, x.current_a.q,  i_d_ref_a,        i_q_ref_a,
      x.flux_wb,     target.flux_wb, x.flux_angle_rad, direct_clipped || quadrature_clipped ? 1.0 : 0.0};
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
}

}  // namespace drivebench::control
