#include "clients/control/induction/quadrature_integrator_controller.hpp"

#include <cmath>

namespace drivebench::control {

std::span<const GainRow<QuadratureIntegratorParameters>> QuadratureIntegratorParameters::gains() noexcept {
  using P = QuadratureIntegratorParameters;
  constexpr GainRule kPositive = GainRule::kPositive;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"current.pole_per_s", [](P& p) -> double& { return p.current_pole_per_s; }, GainRule::kPositive},
      {"angle.pole_per_s", [](P& p) -> double& { return p.angle_pole_per_s; }, kPositive},
      {"slip.pole_per_s", [](P& p) -> double& { return p.slip_pole_per_s; }, kPositive},
      {"load_observer.pole_per_s", [](P& p) -> double& { return p.load_pole_per_s; }, kPositive},
      {"least_i_q_a", [](P& p) -> double& { return p.least_i_q_a; }, kPositive},
  });
  return kRows;
}

std::vector<std::string> QuadratureIntegratorParameters::problems() const {
  return range_problems(*this);
}

QuadratureIntegratorCommand quadrature_integrator(const InductionMachineModel& m, const InductionState& x,
                                                  double alpha_rate_rad_s3,
                                                  double slip_rate_rad_s2) noexcept {
  const double eta = m.flux_decay_per_s();
  const double eta_m = eta * m.mutual_inductance_h;
  const double mu = m.acceleration_per_wb_a();
  const double psi = x.flux_divisor_wb();
  const double b_alpha = alpha_rate_rad_s3 + eta * mu * psi * x.current_a.q;
  const double b_slip = slip_rate_rad_s2 - eta * eta_m * x.current_a.q / psi;
  const double from_alpha = b_alpha / (2.0 * mu * psi);
  const double from_slip = psi * b_slip / (2.0 * eta_m);
  return {.i_d_a = psi * (from_alpha - from_slip) / (eta_m * x.current_a.q),
          .i_q_rate_a_s = from_alpha + from_slip};
}

QuadratureIntegratorController::QuadratureIntegratorController(const InductionDriveParameters& drive,
                                                               const QuadratureIntegratorParameters& p,
                                                               const FluxReferenceParameters& flux) noexcept
    : drive_(drive),
      p_(p),
      feedback_(drive, p.load_pole_per_s),
      flux_reference_(flux, drive.motor.machine, drive.period_s()),
      current_loop_(drive, p.current_pole_per_s) {}

std::span<const std::string_view> QuadratureIntegratorController::telemetry_names() const noexcept {
  static constexpr auto kNames = std::to_array<std::string_view>(
      {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_ref_wb", "load_nm", "singular"});
  return kNames;
}

Setpoint QuadratureIntegratorController::update(const Measurement& m, const Reference& r,
                                                std::int64_t periods) noexcept {
  const InductionMachineModel& machine = drive_.motor.machine;
  const InductionState& x = feedback_.sample(m, periods);
  const FluxTarget target = flux_reference_.step(r, periods);
  const double mu = machine.acceleration_per_wb_a();
  const double eta_m = machine.flux_decay_per_s() * machine.mutual_inductance_h;
  const double pole = p_.angle_pole_per_s;

  const double wanted_rad_s2 = r.acceleration_rad_s2 + machine.friction_rate_per_s() * r.speed_rad_s +
                               feedback_.load_nm() / machine.inertia_kgm2;
  const double wanted_rad_s3 = r.jerk_rad_s3 + machine.friction_rate_per_s() * r.acceleration_rad_s2;
  const double angle_error_rad = r.angle_rad - x.angle_rad;
  const double speed_error_rad_s = r.speed_rad_s - x.speed_rad_s;
  const double slip_per_alpha = eta_m / (mu * target.flux_wb * target.flux_wb);

  double i_q_rate_a_s = 0.0;
  const bool singular = std::abs(x.current_a.q) < p_.least_i_q_a;
  if (singular) {
    const double motor_rad_s2 =
        wanted_rad_s2 + 3.0 * pole * speed_error_rad_s + 3.0 * pole * pole * angle_error_rad;
    reference_a_ = {.d = target.flux_wb / machine.mutual_inductance_h,
                    .q = motor_rad_s2 / (mu * x.flux_divisor_wb())};
  } else {
    const double alpha_error_rad_s2 = wanted_rad_s2 - mu * x.flux_wb * x.current_a.q;
    const double slip_error_rad_s =
        slip_per_alpha * wanted_rad_s2 - eta_m * x.current_a.q / x.flux_divisor_wb();
    const QuadratureIntegratorCommand command = quadrature_integrator(
        machine, x,
        wanted_rad_s3 +
            pole * (3.0 * alpha_error_rad_s2 + pole * (3.0 * speed_error_rad_s + pole * angle_error_rad)),
        slip_per_alpha * wanted_rad_s3 + p_.slip_pole_per_s * slip_error_rad_s);
    reference_a_.d = command.i_d_a;
    i_q_rate_a_s = command.i_q_rate_a_s;
  }
  bool at_limit = false;
  reference_a_ = {.d = clipped(reference_a_.d, drive_.direct_reference_limit_a(), at_limit),
                  .q = clipped(reference_a_.q, drive_.quadrature_reference_limit_a, at_limit)};
  const PhaseCommand command = current_loop_.step(x, reference_a_, {.d = 0.0, .q = i_q_rate_a_s});
  saturated_ = command.saturated;
  telemetry_ = {x.current_a.d, x.current_a.q,  reference_a_.d,      reference_a_.q,
                x.flux_wb,     target.flux_wb, feedback_.load_nm(), singular ? 1.0 : 0.0};
  if (!saturated_) reference_a_.q += drive_.period_s() * i_q_rate_a_s;
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
}

}  // namespace drivebench::control
