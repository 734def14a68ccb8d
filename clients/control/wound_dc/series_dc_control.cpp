#include "clients/control/wound_dc/series_dc_control.hpp"

#include <algorithm>
#include <string>
#include <vector>

namespace drivebench::control {

std::vector<std::string> SeriesDcParameters::problems() const {
  std::vector<std::string> found = wound_dc_problems(
      *this, Polynomial<3>{speed.derivative_per_s, speed.proportional_per_s2, speed.integral_per_s3},
      "speed.integral_per_s3 and the gains beside it make the speed loop unstable");
  if (found.empty() && source == SeriesDcSpeed::kCurrent &&
      !series_dc_observer(axis.machine, observer).stable()) {
    found.emplace_back("current_observer.flux_per_s and the gains beside it make the observer unstable");
  }
  return found;
}

SeriesDcController::SeriesDcController(const SeriesDcParameters& p) noexcept
    : WoundDcController(p.axis, FieldConnection::kSeries), p_(p) {
  if (p.source == SeriesDcSpeed::kCurrent) {
    observer_.emplace(p.axis.machine, p.observer, p.least_current_a, p.axis.period_s(),
                      Discretisation::kTrapezoidal);
  }
}

ShaftEstimate SeriesDcController::seen_from_terminals(double armature_a, const ShaftEstimate& shaft,
                                                      std::int64_t periods) noexcept {
  if (!observer_) return shaft;
  observer_->update(armature_a, last().a, periods);
  return {.angle_rad = shaft.angle_rad,
          .speed_rad_s = observer_->speed_rad_s(),
          .load_rad_s2 = observer_->load_nm() / machine().inertia_kgm2};
}

Setpoint SeriesDcController::voltages(const Reference& r, const WoundDcState& x) noexcept {
  const WoundDcModel& m = machine();
  speed_error_rad_s_ = r.speed_rad_s - x.speed_rad_s;
  const double wanted_jerk =
      p_.speed.integral_per_s3 * speed_integral_rad_ + p_.speed.proportional_per_s2 * speed_error_rad_s_ +
      p_.speed.derivative_per_s * (r.acceleration_rad_s2 - x.motor_rad_s2) + r.jerk_rad_s3;
  const double slope_h = m.flux_slope_h(x.armature_a);
  const double divisor_a = std::max(x.armature_a, p_.least_current_a);
  const double torque_per_a = m.motor_constant * (m.flux_wb(divisor_a) + divisor_a * slope_h);
  const double current_slope =
      (m.inertia_kgm2 * wanted_jerk + m.friction_nms * x.motor_rad_s2) / torque_per_a;
  const double wanted_v = (m.armature_resistance_ohm + m.field_resistance_ohm) * x.armature_a +
                          m.motor_constant * x.flux_wb * x.speed_rad_s +
                          (m.armature_inductance_h + slope_h) * current_slope;
  return {.a = x.armature_a < p_.least_current_a ? std::max(wanted_v, 0.0) : wanted_v};
}

void SeriesDcController::integrate(const Setpoint& excess_v) noexcept {
  speed_integral_rad_ = integrated(speed_integral_rad_, speed_error_rad_s_, excess_v.a);
}

std::vector<std::string> WeakenedSeriesDcParameters::problems() const {
  std::vector<std::string> found =
      wound_dc_problems(*this, Polynomial<2>{speed_proportional_per_s, speed_integral_per_s2},
                        "speed.integral_per_s2 and the gain beside it make the speed loop unstable");
  if (!found.empty()) return found;
  if (axis.machine.field_shunt_resistance_ohm == 0.0)
    found.emplace_back("machine.field_shunt_resistance_ohm must be positive");
  if (!(most_flux_wb > axis.least_flux_wb)) found.emplace_back("most_flux_wb must be above least_flux_wb");
  return found;
}

double WeakenedSeriesDcController::acceleration_of_flux(double flux_wb) const noexcept {
  const WoundDcModel& m = machine();
  const double shunt_ohm = m.field_shunt_resistance_ohm;
  return flux_wb * flux_wb * m.motor_constant * (shunt_ohm + m.field_resistance_ohm) /
         (m.inertia_kgm2 * shunt_ohm * m.flux_slope_h(0.0));
}

Setpoint WeakenedSeriesDcController::voltages(const Reference& r, const WoundDcState& x) noexcept {
  const WoundDcModel& m = machine();
  speed_error_rad_s_ = r.speed_rad_s - x.speed_rad_s;
  const double wanted = r.acceleration_rad_s2 + p_.speed_proportional_per_s * speed_error_rad_s_ +
                        p_.speed_integral_per_s2 * speed_integral_rad_;
  const double given =
      std::clamp(wanted, acceleration_of_flux(p_.axis.least_flux_wb), acceleration_of_flux(p_.most_flux_wb));
  excess_rad_s2_ = wanted - given;
  const double torque_a = given * m.inertia_kgm2 / (m.motor_constant * divisor_wb(x.flux_wb));
  return {.a = -m.field_shunt_resistance_ohm * x.field_a + m.motor_constant * x.flux_wb * x.speed_rad_s +
               torque_a * (m.armature_resistance_ohm + m.field_shunt_resistance_ohm)};
}

void WeakenedSeriesDcController::integrate(const Setpoint& excess_v) noexcept {
  const double excess = excess_v.a != 0.0 ? excess_v.a : excess_rad_s2_;
  speed_integral_rad_ = integrated(speed_integral_rad_, speed_error_rad_s_, excess);
}

}  // namespace drivebench::control
