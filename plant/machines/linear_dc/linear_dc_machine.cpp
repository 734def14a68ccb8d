#include "plant/machines/linear_dc/linear_dc_machine.hpp"

namespace drivebench {

PmDcMachineConstants constants_of(const LinearDcMachineParameters& p) noexcept {
  return constants_of(PmDcMachineParameters{.armature_resistance_ohm = p.resistance_ohm,
                                            .armature_inductance_h = p.inductance_h,
                                            .torque_constant_nm_per_a = p.flux_density_t * p.bar_length_m});
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
