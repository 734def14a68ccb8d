#include "clients/control/wound_dc/separate_dc_control.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace drivebench::control {

FieldWeakening::Flux FieldWeakening::at(const Reference& r) const noexcept {
  const double speed_rad_s = std::abs(r.speed_rad_s);
  if (speed_rad_s <= base_speed_rad_s) return {.flux_wb = rated_flux_wb, .slope_wb_per_s = 0.0};
  const double flux_wb = rated_flux_wb * base_speed_rad_s / speed_rad_s;
  return {.flux_wb = flux_wb, .slope_wb_per_s = -flux_wb * r.acceleration_rad_s2 / r.speed_rad_s};
}

std::vector<std::string> SeparateDcParameters::problems() const {
  return wound_dc_problems(
      *this, Polynomial<3>{speed.derivative_per_s, speed.proportional_per_s2, speed.integral_per_s3},
      "speed.integral_per_s3 and the gains beside it make the speed loop unstable");
}

Setpoint SeparateDcController::voltages(const Reference& r, const WoundDcState& x) noexcept {
  const WoundDcModel& m = machine();
  const FieldWeakening::Flux flux = p_.flux.at(r);
  const double field_v =
      m.field_resistance_ohm * x.field_a + p_.flux_per_s * (flux.flux_wb - x.flux_wb) + flux.slope_wb_per_s;
  const double flux_slope = clamped_field_v(field_v) - m.field_resistance_ohm * x.field_a;

  speed_error_rad_s_ = r.speed_rad_s - x.speed_rad_s;
  const double wanted_jerk =
      p_.speed.integral_per_s3 * speed_integral_rad_ + p_.speed.proportional_per_s2 * speed_error_rad_s_ +
      p_.speed.derivative_per_s * (r.acceleration_rad_s2 - x.motor_rad_s2) + r.jerk_rad_s3;
  const double torque_slope = m.inertia_kgm2 * wanted_jerk + m.friction_nms * x.motor_rad_s2;
  const double current_slope =
      (torque_slope / m.motor_constant - flux_slope * x.armature_a) / divisor_wb(x.flux_wb);
  return {.a = m.armature_resistance_ohm * x.armature_a + m.motor_constant * x.flux_wb * x.speed_rad_s +
               m.armature_inductance_h * current_slope,
          .field = field_v};
}

void SeparateDcController::integrate(const Setpoint& excess_v) noexcept {
  speed_integral_rad_ = integrated(speed_integral_rad_, speed_error_rad_s_, excess_v.a);
}

std::vector<std::string> FieldControlDcParameters::problems() const {
  return wound_dc_problems(
      *this,
      Polynomial<4>{power_slope_per_s, power_per_s2, energy_proportional_per_s3, energy_integral_per_s4},
      "energy.integral_per_s4 and the gains beside it make the energy loop unstable");
}

Setpoint FieldControlDcController::voltages(const Reference& r, const WoundDcState& x) noexcept {
  const WoundDcModel& m = machine();
  const double held_v = m.field_resistance_ohm * x.field_a;
  if (!running_) {
    running_ = r.speed_rad_s >= p_.start_speed_rad_s;
    constexpr double kBuildUpPerS = 20.0;
    return {.a = p_.armature_voltage_v * std::min(1.0, r.speed_rad_s / p_.start_speed_rad_s),
            .field = held_v + kBuildUpPerS * (p_.rated_flux_wb - x.flux_wb)};
  }
  return {.a = p_.armature_voltage_v, .field = held_v + flux_slope(r, x)};
}

double FieldControlDcController::flux_slope(const Reference& r, const WoundDcState& x) noexcept {
  const WoundDcModel& m = machine();
  const double back_emf_per_speed = m.motor_constant * x.flux_wb;
  const double resistive_v = m.armature_resistance_ohm * x.armature_a;
  const double current_slope =
      (p_.armature_voltage_v - resistive_v - back_emf_per_speed * x.speed_rad_s) / m.armature_inductance_h;
  // V_a0 − 2R·i keeps its sign: beyond half the short-circuit current more field would mean less power.
  const double margin_v = std::max(p_.armature_voltage_v - 2.0 * resistive_v, 0.05 * p_.armature_voltage_v);

  const double kinetic_j = m.inertia_kgm2 * x.speed_rad_s * x.speed_rad_s;
  const double energy_j = 0.5 * (m.armature_inductance_h * x.armature_a * x.armature_a + kinetic_j);
  const double power_w = x.armature_a * (p_.armature_voltage_v - resistive_v);
  energy_error_j_ = 0.5 * m.inertia_kgm2 * r.speed_rad_s * r.speed_rad_s - energy_j;
  const double power_error_w = m.inertia_kgm2 * r.speed_rad_s * r.acceleration_rad_s2 - power_w;
  const double slope_error =
      m.inertia_kgm2 * (r.acceleration_rad_s2 * r.acceleration_rad_s2 + r.speed_rad_s * r.jerk_rad_s3) -
      margin_v * current_slope;
  const double wanted = p_.energy_integral_per_s4 * energy_integral_js_ +
                        p_.energy_proportional_per_s3 * energy_error_j_ + p_.power_per_s2 * power_error_w +
                        p_.power_slope_per_s * slope_error;
  const double current_curve =
      (wanted + 2.0 * m.armature_resistance_ohm * current_slope * current_slope) / margin_v;
  const double least_speed_rad_s = 0.1 * p_.start_speed_rad_s;
  return -(m.armature_inductance_h * current_curve + m.armature_resistance_ohm * current_slope +
           back_emf_per_speed * (x.motor_rad_s2 - x.load_rad_s2)) /
         (m.motor_constant * std::max(x.speed_rad_s, least_speed_rad_s));
}

void FieldControlDcController::integrate(const Setpoint& excess_v) noexcept {
  // More energy takes less field.
  if (running_) energy_integral_js_ = integrated(energy_integral_js_, energy_error_j_, -excess_v.field);
}

}  // namespace drivebench::control
