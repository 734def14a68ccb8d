#include "clients/control/induction/dynamic_linearization.hpp"

#include <cmath>
#include <utility>

namespace drivebench::control {

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
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_ref_wb",
                                      "distance", "singular"}),
      drive_(drive),
      p_(p),
      feedback_(drive),
      flux_reference_(flux, drive.motor.machine, drive.period_s(), std::move(optimum)),
      current_loop_(drive, p.current_pole_per_s) {}

Setpoint DirectIntegratorController::step(const Measurement& m, const Reference& r,
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
  const PhaseVoltages command =
      current_loop_.step(x, {.d = i_d_ref_a_, .q = i_q_ref_a}, {.d = i_d_a_s, .q = 0.0});
  tell({.angle_rad = x.angle_rad, .speed_rad_s = x.speed_rad_s, .saturated = command.saturated},
       {x.current_a.d, x.current_a.q, i_d_ref_a_, i_q_ref_a, x.flux_wb, target.flux_wb, distance,
        singular ? 1.0 : 0.0});
  if (!command.saturated && !at_limit) angle_integral_rad_s_ += drive_.period_s() * angle_error_rad;
  if (!command.saturated) {
    i_d_ref_a_ =
        clipped(i_d_ref_a_ + drive_.period_s() * i_d_a_s, drive_.direct_reference_limit_a(), at_limit);
  }
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
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
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_ref_wb",
                                      "load_nm", "singular"}),
      drive_(drive),
      p_(p),
      feedback_(drive, p.load_pole_per_s),
      flux_reference_(flux, drive.motor.machine, drive.period_s()),
      current_loop_(drive, p.current_pole_per_s) {}

Setpoint QuadratureIntegratorController::step(const Measurement& m, const Reference& r,
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
  const PhaseVoltages command = current_loop_.step(x, reference_a_, {.d = 0.0, .q = i_q_rate_a_s});
  tell({.angle_rad = x.angle_rad, .speed_rad_s = x.speed_rad_s, .saturated = command.saturated},
       {x.current_a.d, x.current_a.q, reference_a_.d, reference_a_.q, x.flux_wb, target.flux_wb,
        feedback_.load_nm(), singular ? 1.0 : 0.0});
  if (!command.saturated) reference_a_.q += drive_.period_s() * i_q_rate_a_s;
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
}

FlatInductionState flat_induction(const InductionMachineModel& m, double slip_rad_s, double torque_nm,
                                  double torque_rate_nm_s) noexcept {
  const double eta = m.flux_decay_per_s();
  const double eta_m = eta * m.mutual_inductance_h;
  const double flux_wb = std::sqrt(m.rotor_resistance_ohm * torque_nm / (m.pole_pairs * slip_rad_s));
  const double rate_wb_s = flux_wb * torque_rate_nm_s / (2.0 * torque_nm);
  return {.flux_wb = flux_wb,
          .flux_rate_wb_s = rate_wb_s,
          .current_a = {.d = (eta * flux_wb + rate_wb_s) / eta_m, .q = flux_wb * slip_rad_s / eta_m},
          .i_q_rate_a_s = rate_wb_s * slip_rad_s / eta_m};
}

FlatInductionController::FlatInductionController(const InductionDriveParameters& drive,
                                                 const FlatInductionParameters& p) noexcept
    : Controller(Quantity::kVoltage, {"i_d_a", "i_q_a", "i_d_ref_a", "i_q_ref_a", "flux_wb", "flux_ref_wb",
                                      "load_nm", "singular"}),
      drive_(drive),
      p_(p),
      feedback_(drive, p.load_pole_per_s),
      current_loop_(drive, p.current_pole_per_s) {}

Setpoint FlatInductionController::step(const Measurement& m, const Reference& r,
                                       std::int64_t periods) noexcept {
  const InductionMachineModel& machine = drive_.motor.machine;
  const InductionState& x = feedback_.sample(m, periods);
  const double wanted_nm = machine.inertia_kgm2 * r.acceleration_rad_s2 +
                           machine.friction_nms * r.speed_rad_s + feedback_.load_nm();
  const bool singular = !(wanted_nm >= p_.least_torque_nm);
  const FlatInductionState flat = singular ? flat_induction(machine, p_.slip_rad_s, p_.least_torque_nm, 0.0)
                                           : flat_induction(machine, p_.slip_rad_s, wanted_nm,
                                                            machine.inertia_kgm2 * r.jerk_rad_s3 +
                                                                machine.friction_nms * r.acceleration_rad_s2);

  const double angle_error_rad = r.angle_rad - x.angle_rad;
  const double motor_rad_s2 = wanted_nm / machine.inertia_kgm2 +
                              p_.position.integral_per_s3 * angle_integral_rad_s_ +
                              p_.position.proportional_per_s2 * angle_error_rad +
                              p_.position.derivative_per_s * (r.speed_rad_s - x.speed_rad_s);
  bool at_limit = false;
  const Dq reference_a = {.d = clipped(flat.current_a.d, drive_.direct_reference_limit_a(), at_limit),
                          .q = clipped(motor_rad_s2 / (machine.acceleration_per_wb_a() * x.flux_divisor_wb()),
                                       drive_.quadrature_reference_limit_a, at_limit)};
  const PhaseVoltages command = current_loop_.step(x, reference_a, {.d = 0.0, .q = flat.i_q_rate_a_s});
  tell({.angle_rad = x.angle_rad, .speed_rad_s = x.speed_rad_s, .saturated = command.saturated},
       {x.current_a.d, x.current_a.q, reference_a.d, reference_a.q, x.flux_wb, flat.flux_wb,
        feedback_.load_nm(), singular ? 1.0 : 0.0});
  if (!command.saturated && !at_limit) angle_integral_rad_s_ += drive_.period_s() * angle_error_rad;
  return {.a = command.voltage_v.a, .b = command.voltage_v.b};
}

}  // namespace drivebench::control
