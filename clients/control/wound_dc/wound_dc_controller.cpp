#include "clients/control/wound_dc/wound_dc_controller.hpp"

#include <algorithm>

namespace drivebench::control {

WoundDcController::WoundDcController(const WoundDcAxisParameters& axis,
                                     FieldConnection field_connection) noexcept
    : Controller(Quantity::kVoltage, {"speed_error_rad_s", "flux_wb", "speed_rad_s", "load_rad_s2"}),
      axis_(axis),
      field_connection_(field_connection),
      shaft_(axis.shaft, axis.machine.friction_rate_per_s(), axis.period_s()) {}

double WoundDcController::clamped_armature_v(double wanted_v) const noexcept {
  return std::clamp(wanted_v, -axis_.voltage_limit_v, axis_.voltage_limit_v);
}

double WoundDcController::clamped_field_v(double wanted_v) const noexcept {
  return std::clamp(wanted_v, -axis_.field_voltage_limit_v, axis_.field_voltage_limit_v);
}

double WoundDcController::divisor_wb(double flux_wb) const noexcept {
  return flux_wb < 0.0 ? std::min(flux_wb, -axis_.least_flux_wb) : std::max(flux_wb, axis_.least_flux_wb);
}

ShaftEstimate WoundDcController::seen_from_terminals(double, const ShaftEstimate& shaft,
                                                     std::int64_t) noexcept {
  return shaft;
}

Setpoint WoundDcController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  const WoundDcModel& machine = axis_.machine;
  const bool whole_field =
      field_connection_ == FieldConnection::kSeries && machine.field_shunt_resistance_ohm == 0.0;
  const double armature_a = field_connection_ == FieldConnection::kShunt ? m.i_a_a - m.i_f_a : m.i_a_a;
  const double field_a = whole_field ? m.i_a_a : m.i_f_a;
  const double flux_wb = machine.flux_wb(field_a);
  const double motor_rad_s2 = machine.torque_nm(flux_wb, armature_a) / machine.inertia_kgm2;
  const ShaftEstimate shaft =
      seen_from_terminals(armature_a, shaft_.update(m, motor_rad_s2, periods), periods);

  const Setpoint wanted =
      voltages(r, {.speed_rad_s = shaft.speed_rad_s,
                   .load_rad_s2 = shaft.load_rad_s2,
                   .armature_a = armature_a,
                   .field_a = field_a,
                   .flux_wb = flux_wb,
                   .motor_rad_s2 = motor_rad_s2 - machine.friction_rate_per_s() * shaft.speed_rad_s});
  last_ = {.a = clamped_armature_v(wanted.a), .field = clamped_field_v(wanted.field)};
  integrate({.a = wanted.a - last_.a, .field = wanted.field - last_.field});
  tell({.angle_rad = shaft_.now().angle_rad,
        .speed_rad_s = shaft.speed_rad_s,
        .saturated = last_.a != wanted.a || last_.field != wanted.field},
       {r.speed_rad_s - shaft.speed_rad_s, flux_wb, shaft.speed_rad_s, shaft.load_rad_s2});
  return last_;
}

}  // namespace drivebench::control
