#include "plant/machines/series_dc/series_dc_machine.hpp"

namespace drivebench {

SeriesDcMachineConstants constants_of(const SeriesDcMachineParameters& p) noexcept {
  return {.resistance_ohm = p.armature_resistance_ohm,
          .inductance_h = p.armature_inductance_h,
          .per_inductance = 1.0 / p.armature_inductance_h,
          .motor_constant = p.motor_constant,
          .field_resistance_ohm = p.field_resistance_ohm,
          .loop_resistance_ohm = p.armature_resistance_ohm + p.field_resistance_ohm,
          .shunt_resistance_ohm = p.field_shunt_resistance_ohm,
          .split_per_s =
              p.field_shunt_resistance_ohm > 0.0
                  ? (p.armature_resistance_ohm + p.field_shunt_resistance_ohm) / p.armature_inductance_h
                  : 0.0,
          .shunted = p.field_shunt,
          .simple = p.saturation_curve.empty() && p.field_shunt_resistance_ohm == 0.0,
          .field = field_winding(p.field_inductance_h, p.saturation_curve, p.armature_inductance_h)};
}

SeriesCircuit series_circuit(const SeriesDcMachineConstants& c, SeriesDcMachineState x) noexcept {
  if (c.shunted) {
    const double flux_wb = x.linkage_wb - c.inductance_h * x.armature_a;
    return {x.armature_a, field_current_a(c.field, flux_wb), flux_wb};
  }
  const double current_a = loop_current_a(c.field, x.linkage_wb);
  return {current_a, current_a, x.linkage_wb - c.inductance_h * current_a};
}

SeriesDcMachineState full_derivative(const SeriesDcMachineConstants& c, SeriesDcMachineState x,
                                     double speed_rad_s, double voltage_v) noexcept {
  const SeriesCircuit s = series_circuit(c, x);
  const double armature_v =
      voltage_v - c.resistance_ohm * s.armature_a - c.motor_constant * s.flux_wb * speed_rad_s;
  const double linkage_slope = armature_v - c.field_resistance_ohm * s.field_a;
  double current_slope = 0.0;
  if (c.shunted) {
    current_slope = (armature_v - c.shunt_resistance_ohm * (s.armature_a - s.field_a)) * c.per_inductance;
  } else if (c.split_per_s != 0.0) {
    current_slope = linkage_slope * differential_per_loop_inductance(c.field, s.armature_a) +
                    c.split_per_s * (s.armature_a - x.armature_a);
  }
  return {.linkage_wb = linkage_slope, .armature_a = current_slope};
}

SeriesDcMachineState open_derivative(const SeriesDcMachineConstants& c, SeriesDcMachineState x) noexcept {
  if (!c.shunted)
    return {.linkage_wb = -c.split_per_s * x.linkage_wb, .armature_a = -c.split_per_s * x.armature_a};
  const double field_a = field_current_a(c.field, x.linkage_wb);
  return {.linkage_wb = -(c.shunt_resistance_ohm + c.field_resistance_ohm) * field_a, .armature_a = 0.0};
}

double full_torque_nm(const SeriesDcMachineConstants& c, SeriesDcMachineState x) noexcept {
  const SeriesCircuit s = series_circuit(c, x);
  return c.motor_constant * s.flux_wb * s.armature_a;
}

SeriesDcMachineState restricted(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                                const RotorMotion&, const TerminalInput& u) noexcept {
  if (u.conduction != Conduction::kNone) return x;
  if (!c.shunted) return {};
  return {.linkage_wb = x.linkage_wb - c.inductance_h * x.armature_a, .armature_a = 0.0};
}

WindingValues open_circuit_voltages(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                                    const RotorMotion& motion) noexcept {
  const SeriesCircuit s = series_circuit(c, x);
  const double emf_v = c.motor_constant * s.flux_wb * motion.speed_rad_s;
  return {.stator = {c.shunted ? emf_v - c.shunt_resistance_ohm * s.field_a : emf_v, 0.0}};
}

TwoPhase rotor_flux_wb(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                       const RotorMotion&) noexcept {
  return {series_circuit(c, x).flux_wb, 0.0};
}

double stored_energy_j(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                       const RotorMotion&) noexcept {
  const SeriesCircuit s = series_circuit(c, x);
  return 0.5 * c.inductance_h * s.armature_a * s.armature_a + field_energy_j(c.field, s.field_a);
}

double losses_w(const SeriesDcMachineConstants& c, const SeriesDcMachineState& x,
                const RotorMotion&) noexcept {
  const SeriesCircuit s = series_circuit(c, x);
  const double shunt_a = s.armature_a - s.field_a;  // zero with the switch open
  return c.resistance_ohm * s.armature_a * s.armature_a + c.field_resistance_ohm * s.field_a * s.field_a +
         c.shunt_resistance_ohm * shunt_a * shunt_a;
}

Connection connection_of(const SeriesDcMachineParameters&) noexcept {
  return Connection::kArmature;
}

double pole_pairs_of(const SeriesDcMachineParameters&) noexcept {
  return 0.0;
}

SeriesDcMachineParameters adjusted(const SeriesDcMachineParameters& p, const Adjustment& a) noexcept {
  SeriesDcMachineParameters result = p;
  result.armature_resistance_ohm =
      p.armature_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.armature_inductance_h = p.armature_inductance_h + a.series_inductance_h;
  result.field_resistance_ohm = p.field_resistance_ohm * a.rotor_resistance_factor;
  return result;
}

double fastest_time_constant_s(const SeriesDcMachineParameters& p) noexcept {
  const double field_h = smallest_inductance_h(p.field_inductance_h, p.saturation_curve);
  if (p.field_shunt_resistance_ohm == 0.0)
    return (p.armature_inductance_h + field_h) / (p.armature_resistance_ohm + p.field_resistance_ohm);
  // The sum of both rates is their trace, and neither is negative.
  return 1.0 / ((p.armature_resistance_ohm + p.field_shunt_resistance_ohm) / p.armature_inductance_h +
                (p.field_shunt_resistance_ohm + p.field_resistance_ohm) / field_h);
}

}  // namespace drivebench
