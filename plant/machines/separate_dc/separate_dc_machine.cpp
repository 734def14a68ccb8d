#include "plant/machines/separate_dc/separate_dc_machine.hpp"

#include <algorithm>
#include <numbers>

#include "plant/math/rounding.hpp"

namespace drivebench {

SeparateDcMachineConstants constants_of(const SeparateDcMachineParameters& p) noexcept {
  const auto loops = static_cast<double>(p.armature_loops);
  return {.resistance_ohm = p.armature_resistance_ohm,
          .inductance_h = p.armature_inductance_h,
          .per_inductance = 1.0 / p.armature_inductance_h,
          .motor_constant = p.motor_constant,
          .field_resistance_ohm = p.field_resistance_ohm,
          .coupling_per_rad = p.field_coupling ? p.motor_constant / loops : 0.0,
          .segments_per_rad = loops / std::numbers::pi,
          .field = field_winding(p.field_inductance_h, p.saturation_curve, 0.0)};
}

double commutator_sawtooth(const SeparateDcMachineConstants& c, double angle_rad) noexcept {
  const double segments = angle_rad * c.segments_per_rad;
  const double part = segments - static_cast<double>(floor_to_integer(segments));
  return std::numbers::pi * (0.5 - part);
}

SeparateDcMachineState restricted(const SeparateDcMachineConstants&, const SeparateDcMachineState& x,
                                  const RotorMotion&, const TerminalInput& u) noexcept {
  if (u.conduction == Conduction::kNone) return {.i_a_a = 0.0, .field_flux_wb = x.field_flux_wb};
  return x;
}

WindingValues open_circuit_voltages(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                                    const RotorMotion& motion) noexcept {
  return {.stator = {c.motor_constant * x.field_flux_wb * motion.speed_rad_s, 0.0}};
}

TwoPhase rotor_flux_wb(const SeparateDcMachineConstants&, const SeparateDcMachineState& x,
                       const RotorMotion&) noexcept {
  return {x.field_flux_wb, 0.0};
}

double stored_energy_j(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                       const RotorMotion&) noexcept {
  return 0.5 * c.inductance_h * x.i_a_a * x.i_a_a +
         field_energy_j(c.field, field_current_a(c.field, x.field_flux_wb));
}

double losses_w(const SeparateDcMachineConstants& c, const SeparateDcMachineState& x,
                const RotorMotion&) noexcept {
  const double field_a = field_current_a(c.field, x.field_flux_wb);
  return c.resistance_ohm * x.i_a_a * x.i_a_a + c.field_resistance_ohm * field_a * field_a;
}

Connection connection_of(const SeparateDcMachineParameters&) noexcept {
  return Connection::kArmature;
}

double pole_pairs_of(const SeparateDcMachineParameters&) noexcept {
  return 0.0;
}

SeparateDcMachineParameters adjusted(const SeparateDcMachineParameters& p, const Adjustment& a) noexcept {
  SeparateDcMachineParameters result = p;
  result.armature_resistance_ohm =
      p.armature_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm;
  result.armature_inductance_h = p.armature_inductance_h + a.series_inductance_h;
  result.field_resistance_ohm = p.field_resistance_ohm * a.rotor_resistance_factor;
  return result;
}

double fastest_time_constant_s(const SeparateDcMachineParameters& p) noexcept {
  return std::min(p.armature_inductance_h / p.armature_resistance_ohm,
                  smallest_inductance_h(p.field_inductance_h, p.saturation_curve) / p.field_resistance_ohm);
}

}  // namespace drivebench
