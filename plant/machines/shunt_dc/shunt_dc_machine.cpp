#include "plant/machines/shunt_dc/shunt_dc_machine.hpp"

#include <algorithm>

namespace drivebench {
namespace {

/// Field current of the loop that armature and field form while the terminals are open.
double circulating_a(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x) noexcept {
  return loop_current_a(c.field, x.field_flux_wb - c.inductance_h * x.armature_a);
}

}  // namespace

ShuntDcMachineConstants constants_of(const ShuntDcMachineParameters& p) noexcept {
  return {.resistance_ohm = p.armature_resistance_ohm,
          .inductance_h = p.armature_inductance_h,
          .per_inductance = 1.0 / p.armature_inductance_h,
          .motor_constant = p.motor_constant,
          .circuit_resistance_ohm = p.field_resistance_ohm + p.adjusting_resistance_ohm,
          .field = field_winding(p.field_inductance_h, p.saturation_curve, p.armature_inductance_h)};
}

ShuntDcMachineState open_derivative(const ShuntDcMachineConstants& c, ShuntDcMachineState x,
                                    double speed_rad_s) noexcept {
  const double field_a = circulating_a(c, x);
  const double loop_slope = c.motor_constant * x.field_flux_wb * speed_rad_s -
                            (c.resistance_ohm + c.circuit_resistance_ohm) * field_a;
  // The second term is zero but for what a step over a kink of the curve leaves.
  const double armature_slope = -loop_slope * differential_per_loop_inductance(c.field, field_a) -
                                c.resistance_ohm * c.per_inductance * (x.armature_a + field_a);
  return {.armature_a = armature_slope, .field_flux_wb = loop_slope + c.inductance_h * armature_slope};
}

ShuntDcMachineState restricted(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                               const RotorMotion&, const TerminalInput& u) noexcept {
  if (u.conduction != Conduction::kNone) return x;
  const double field_a = circulating_a(c, x);
  return {.armature_a = -field_a,
          .field_flux_wb = x.field_flux_wb - c.inductance_h * (x.armature_a + field_a)};
}

WindingValues open_circuit_voltages(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                                    const RotorMotion& motion) noexcept {
  const ShuntDcMachineState slope = open_derivative(c, x, motion.speed_rad_s);
  return {.stator = {c.circuit_resistance_ohm * circulating_a(c, x) + slope.field_flux_wb, 0.0}};
}

TwoPhase rotor_flux_wb(const ShuntDcMachineConstants&, const ShuntDcMachineState& x,
                       const RotorMotion&) noexcept {
  return {x.field_flux_wb, 0.0};
}

double stored_energy_j(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x,
                       const RotorMotion&) noexcept {
  return 0.5 * c.inductance_h * x.armature_a * x.armature_a +
         field_energy_j(c.field, field_current_a(c.field, x.field_flux_wb));
}

double losses_w(const ShuntDcMachineConstants& c, const ShuntDcMachineState& x, const RotorMotion&) noexcept {
  const double field_a = field_current_a(c.field, x.field_flux_wb);
  return c.resistance_ohm * x.armature_a * x.armature_a + c.circuit_resistance_ohm * field_a * field_a;
}

Connection connection_of(const ShuntDcMachineParameters&) noexcept {
  return Connection::kArmature;
}

double pole_pairs_of(const ShuntDcMachineParameters&) noexcept {
  return 0.0;
}

ShuntDcMachineParameters adjusted(const ShuntDcMachineParameters& p, const Adjustment& a) noexcept {
  ShuntDcMachineParameters result = p;
  result.armature_resistance_ohm =
      p.armature_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.armature_inductance_h = p.armature_inductance_h + a.series_inductance_h;
  result.field_resistance_ohm = p.field_resistance_ohm * a.rotor_resistance_factor;
  return result;
}

double fastest_time_constant_s(const ShuntDcMachineParameters& p) noexcept {
  return std::min(p.armature_inductance_h / p.armature_resistance_ohm,
                  smallest_inductance_h(p.field_inductance_h, p.saturation_curve) /
                      (p.field_resistance_ohm + p.adjusting_resistance_ohm));
}

}  // namespace drivebench
