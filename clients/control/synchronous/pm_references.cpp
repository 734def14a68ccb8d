#include "clients/control/synchronous/pm_references.hpp"

namespace drivebench::control {

double optimal_direct_current_a(const PmMachineModel& p, double speed_rad_s) noexcept {
  const double reactance_ohm = p.pole_pairs * speed_rad_s * p.inductance_h;
  return -reactance_ohm * p.torque_constant_nm_per_a * speed_rad_s /
         (p.resistance_ohm * p.resistance_ohm + reactance_ohm * reactance_ohm);
}

PmReferences pm_references(const PmMachineModel& p, const Reference& r) noexcept {
  const double reactance_ohm = p.pole_pairs * r.speed_rad_s * p.inductance_h;
  const double square_ohm2 = p.resistance_ohm * p.resistance_ohm + reactance_ohm * reactance_ohm;
  const Dq i{.d = optimal_direct_current_a(p, r.speed_rad_s),
             .q = (p.inertia_kgm2 * r.acceleration_rad_s2 + p.friction_nms * r.speed_rad_s) /
                  p.torque_constant_nm_per_a};
  const Dq slope{.d = -2.0 * p.torque_constant_nm_per_a * reactance_ohm * p.resistance_ohm *
                      p.resistance_ohm * r.acceleration_rad_s2 / (square_ohm2 * square_ohm2),
                 .q = (p.inertia_kgm2 * r.jerk_rad_s3 + p.friction_nms * r.acceleration_rad_s2) /
                      p.torque_constant_nm_per_a};
  return {.current_a = i,
          .slope_a_per_s = slope,
          .voltage_v = {.d = p.inductance_h * slope.d + p.resistance_ohm * i.d - reactance_ohm * i.q,
                        .q = p.inductance_h * slope.q + p.resistance_ohm * i.q + reactance_ohm * i.d +
                             p.torque_constant_nm_per_a * r.speed_rad_s}};
}

}  // namespace drivebench::control
