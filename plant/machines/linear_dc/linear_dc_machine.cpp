#include "plant/machines/linear_dc/linear_dc_machine.hpp"

namespace drivebench {

LinearDcMachineConstants constants_of(const LinearDcMachineParameters& p) noexcept {
  return {.resistance_ohm = p.resistance_ohm,
          .inductance_h = p.inductance_h,
          .per_inductance = 1.0 / p.inductance_h,
          .force_constant_n_per_a = p.flux_density_t * p.bar_length_m};
}

LinearDcMachineState restricted(const LinearDcMachineConstants&, const LinearDcMachineState& x,
                                const RotorMotion&, const TerminalInput& u) noexcept {
  return u.conduction == Conduction::kNone ? LinearDcMachineState{} : x;
}

WindingValues open_circuit_voltages(const LinearDcMachineConstants& c, const LinearDcMachineState&,
                                    const RotorMotion& motion) noexcept {
  return {.stator = {c.force_constant_n_per_a * motion.speed_rad_s, 0.0}};
}

TwoPhase rotor_flux_wb(const LinearDcMachineConstants& c, const LinearDcMachineState&,
                       const RotorMotion&) noexcept {
  return {c.force_constant_n_per_a, 0.0};
}

double stored_energy_j(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                       const RotorMotion&) noexcept {
  return 0.5 * c.inductance_h * x.i_a_a * x.i_a_a;
}

double losses_w(const LinearDcMachineConstants& c, const LinearDcMachineState& x,
                const RotorMotion&) noexcept {
  return c.resistance_ohm * x.i_a_a * x.i_a_a;
}

Connection connection_of(const LinearDcMachineParameters&) noexcept {
  return Connection::kArmature;
}

double pole_pairs_of(const LinearDcMachineParameters&) noexcept {
  return 0.0;
}

LinearDcMachineParameters adjusted(const LinearDcMachineParameters& p, const Adjustment& a) noexcept {
  return {.resistance_ohm = p.resistance_ohm * a.stator_resistance_factor + a.series_resistance_ohm,
          .inductance_h = p.inductance_h + a.series_inductance_h,
          .flux_density_t = p.flux_density_t * a.magnet_factor,
          .bar_length_m = p.bar_length_m};
}

double fastest_time_constant_s(const LinearDcMachineParameters& p) noexcept {
  return p.inductance_h / p.resistance_ohm;
}

}  // namespace drivebench
