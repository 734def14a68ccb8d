#include "plant/machines/pm_dc/pm_dc_machine.hpp"

namespace drivebench {

PmDcMachineConstants constants_of(const PmDcMachineParameters& p) noexcept {
  return {.resistance_ohm = p.armature_resistance_ohm,
          .inductance_h = p.armature_inductance_h,
          .per_inductance = 1.0 / p.armature_inductance_h,
          .torque_constant_nm_per_a = p.torque_constant_nm_per_a};
}

PmDcMachineState restricted(const PmDcMachineConstants&, const PmDcMachineState& x, const RotorMotion&,
                            const TerminalInput& u) noexcept {
  return u.conduction == Conduction::kNone ? PmDcMachineState{} : x;
}

WindingValues open_circuit_voltages(const PmDcMachineConstants& c, const PmDcMachineState&,
                                    const RotorMotion& motion) noexcept {
  return {.stator = {c.torque_constant_nm_per_a * motion.speed_rad_s, 0.0}};
}

TwoPhase rotor_flux_wb(const PmDcMachineConstants& c, const PmDcMachineState&, const RotorMotion&) noexcept {
  return {c.torque_constant_nm_per_a, 0.0};
}

double stored_energy_j(const PmDcMachineConstants& c, const PmDcMachineState& x,
                       const RotorMotion&) noexcept {
  return 0.5 * c.inductance_h * x.i_a_a * x.i_a_a;
}

double losses_w(const PmDcMachineConstants& c, const PmDcMachineState& x, const RotorMotion&) noexcept {
  return c.resistance_ohm * x.i_a_a * x.i_a_a;
}

Connection connection_of(const PmDcMachineParameters&) noexcept {
  return Connection::kArmature;
}

double pole_pairs_of(const PmDcMachineParameters&) noexcept {
  return 0.0;
}

PmDcMachineParameters adjusted(const PmDcMachineParameters& p, const Adjustment& a) noexcept {
  return {.armature_resistance_ohm =
              p.armature_resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm,
          .armature_inductance_h = p.armature_inductance_h + a.series_inductance_h,
          .torque_constant_nm_per_a = p.torque_constant_nm_per_a * a.magnet_factor};
}

double fastest_time_constant_s(const PmDcMachineParameters& p) noexcept {
  return p.armature_inductance_h / p.armature_resistance_ohm;
}

}  // namespace drivebench
