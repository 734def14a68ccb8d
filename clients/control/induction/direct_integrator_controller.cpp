#include "clients/control/induction/direct_integrator_controller.hpp"

#include <utility>

#include "clients/control/gains/gain_rows.hpp"

namespace drivebench::control {

std::span<const GainRow<DirectIntegratorParameters>> DirectIntegratorParameters::gains() noexcept {
  using P = DirectIntegratorParameters;
  constexpr GainRule kNotNegative = GainRule::kNotNegative;
  static constexpr auto kRows = joined(
      std::to_array<GainRow<P>>({
          {"current.pole_per_s", [](P& p) -> double& { return p.current_pole_per_s; }, GainRule::kPositive},
      }),
      position_rows<P>(),
      std::to_array<GainRow<P>>({
          {"flux.proportional_per_s2", [](P& p) -> double& { return p.flux_proportional_per_s2; },
           kNotNegative},
          {"flux.derivative_per_s", [](P& p) -> double& { return p.flux_derivative_per_s; }, kNotNegative},
          {"least_distance", [](P& p) -> double& { return p.least_distance; }, GainRule::kPositive},
      }));
  return kRows;
}

std::vector<std::string> DirectIntegratorParameters::problems() const {
  return range_problems(*this);
}

SpeedFactor SpeedFactor::at(const InductionMachineModel& m, double flux_wb, double rate_wb_s,
                            double second_rate_wb_s2) noexcept {
  const double g =
      m.flux_decay_per_s() * m.mutual_inductance_h / (m.acceleration_per_wb_a() * flux_wb * flux_wb);
  const double growth_per_s = rate_wb_s / flux_wb;
  const double friction_per_s = m.friction_rate_per_s();
  return {.c = m.pole_pairs + g * (friction_per_s + 2.0 * growth_per_s),
          .c_per_s =
              2.0 * g * (second_rate_wb_s2 / flux_wb - growth_per_s * (friction_per_s + 3.0 * growth_per_s))};
}

DirectIntegratorController::DirectIntegratorController(
    const InductionDriveParameters& drive, const DirectIntegratorParameters& p,
    const FluxReferenceParameters& flux, std::shared_ptr<const OptimumTorqueTable> optimum) noexcept
    : drive_(drive),
      p_(p),
      feedback_(drive),
      flux_reference_(flux, drive.motor.machine, drive.period_s(), std::move(optimum)),
      current_loop_(drive, p.current_pole_per_s) {}

std::span<const std::string_view> DirectIntegratorController::telemetry_names() const noexcept {
  static constexpr auto kNames = std::to_array<std::string_view>(
      {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_ref_wb", "distance", "singular"});
  return kNames;
}

Setpoint DirectIntegratorController::update(const Measurement& m, const Reference& r,
                                            std::int64_t periods) noexcept {
  const InductionMachineModel& machine = drive_.motor.machine;
  const InductionState& x = feedback_.sample(m, periods);
  const FluxTarget target = flux_reference_.step(r, periods);
  const double eta = machine.flux_decay_per_s();
  const double psi = x.flux_divisor_wb();
  const double flux_rate_wb_s = eta * (machine.mutual_inductance_h * i_d_ref_a_ - x.flux_wb);
  const double v_flux = target.second_rate_wb_s2 +
                        p_.flux_derivative_per_s * (target.rate_wb_s - flux_rate_wb_s) +
                        p_.flux_proportional_per_s2 * (target.flux_wb - x.flux_wb);

  SpeedFactor factor = SpeedFactor::at(machine, psi, flux_rate_wb_s, v_flux);
  const double distance = factor.c / machine.pole_pairs;
  const bool singular = !(distance >= p_.least_distance);
  if (singular) factor = {.c = machine.pole_pairs, .c_per_s = 0.0};

  const double angle_error_rad = r.angle_rad - x.angle_rad;
  const double speed_error_rad_s = r.speed_rad_s - x.speed_rad_s;
  const double v_y = factor.c * r.acceleration_rad_s2 + factor.c_per_s * r.speed_rad_s +
                     p_.position.derivative_per_s * factor.c * speed_error_rad_s +
                     machine.pole_pairs * (p_.position.proportional_per_s2 * angle_error_rad +
                                           p_.position.integral_per_s3 * angle_integral_rad_s_);
  const double motor_rad_s2 =
      (v_y - x.speed_rad_s * factor.c_per_s) / factor.c + machine.friction_rate_per_s() * x.speed_rad_s;
  bool at_limit = false;
  const double i_q_ref_a = clipped(motor_rad_s2 / (machine.acceleration_per_wb_a() * psi),
                                   drive_.quadrature_reference_limit_a, at_limit);

  const double i_d_a_s = (v_flux + eta * flux_rate_wb_s) / (eta * machine.mutual_inductance_h);
  const PhaseCommand command =
      current_loop_.step(x, {.d = i_d_ref_a_, .q = i_q_ref_a}, {.d = i_d_a_s, .q = 0.0});
  saturated_ = command.saturated;
  telemetry_ = {x.current_a.d, x.current_a.q,  i_d_ref_a_, i_q_ref_a,
                x.flux_wb,     target.flux_wb, distance,   singular ? 1.0 : 0.0};
  if (!saturated_ && !at_limit) angle_integral_rad_s_ += drive_.period_s() * angle_error_rad;
  if (!saturated_) {
    i_d_ref_a_ =
        clipped(i_d_ref_a_ + drive_.period_s() * i_d_a_s, drive_.direct_reference_limit_a(), at_limit);
  }
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
}

}  // namespace drivebench::control
