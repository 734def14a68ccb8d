#include "clients/control/induction/decoupled_current_loop.hpp"

namespace drivebench::control {

DirectQuadrature decoupled_voltage_v(const InductionMotorModel& motor, const InductionState& x,
                                     DirectQuadrature rate_a_s) noexcept {
  const InductionMachineModel& m = motor.machine;
  const double eta = m.flux_decay_per_s();
  const double gamma = motor.current_decay_per_s();
  const double beta = motor.current_per_wb();
  const double electrical_rad_s = m.pole_pairs * x.speed_rad_s;
  const double flux_speed_rad_s =
      electrical_rad_s + eta * m.mutual_inductance_h * x.current_a.q / x.flux_divisor_wb();
  const auto [i_d, i_q] = x.current_a;
  return {.d = motor.leakage_inductance_h() *
               (gamma * i_d - eta * beta * x.flux_wb - flux_speed_rad_s * i_q + rate_a_s.d),
          .q = motor.leakage_inductance_h() *
               (gamma * i_q + beta * electrical_rad_s * x.flux_wb + flux_speed_rad_s * i_d + rate_a_s.q)};
}

PhaseCommand held_voltage(const InductionDriveParameters& drive, const InductionState& x,
                          DirectQuadrature voltage_v) noexcept {
  const double ahead_rad = 0.5 * drive.period_s() * drive.motor.machine.pole_pairs * x.speed_rad_s;
  const PhasePair wanted_v = Direction::at(x.flux_angle_rad + ahead_rad).to_ab(voltage_v);
  bool saturated = false;
  const PhasePair given_v = {.a = clipped(wanted_v.a, drive.voltage_limit_v, saturated),
                             .b = clipped(wanted_v.b, drive.voltage_limit_v, saturated)};
  return {.voltage_v = given_v, .saturated = saturated};
}

PhaseCommand DecoupledCurrentLoop::step(const InductionState& x, DirectQuadrature reference_a,
                                        DirectQuadrature reference_rate_a_s) const noexcept {
  const DirectQuadrature rate_a_s = {
      .d = reference_rate_a_s.d + pole_per_s_ * (reference_a.d - x.current_a.d),
      .q = reference_rate_a_s.q + pole_per_s_ * (reference_a.q - x.current_a.q)};
  return held_voltage(drive_, x, decoupled_voltage_v(drive_.motor, x, rate_a_s));
}

}  // namespace drivebench::control
