#pragma once

#include <array>

#include "clients/control/gain_rows.hpp"

namespace drivebench::control {

/// The rows of P.machine, a PmMachineModel, and of what every controller of one has.
template <class P>
constexpr auto pm_machine_rows() {
  constexpr GainRule kPositive = GainRule::kPositive;
  constexpr GainRule kNotNegative = GainRule::kNotNegative;
  return joined(
      std::to_array<GainRow<P>>({
          {"machine.pole_pairs", [](P& p) -> double& { return p.machine.pole_pairs; }, kPositive},
          {"machine.resistance_ohm", [](P& p) -> double& { return p.machine.resistance_ohm; }, kPositive},
          {"machine.inductance_h", [](P& p) -> double& { return p.machine.inductance_h; }, kPositive},
          {"machine.torque_constant_nm_per_a",
           [](P& p) -> double& { return p.machine.torque_constant_nm_per_a; }, kPositive},
          {"machine.friction_nms", [](P& p) -> double& { return p.machine.friction_nms; }, kNotNegative},
          {"machine.inertia_kgm2", [](P& p) -> double& { return p.machine.inertia_kgm2; }, kPositive},
          {"sample_rate_hz", [](P& p) -> double& { return p.sample_rate_hz; }, kPositive},
          {"counts_per_revolution", [](P& p) -> double& { return p.counts_per_revolution; }, kPositive},
      }),
      speed_observer_rows<P>(),
      std::to_array<GainRow<P>>({
          {"angle_lead_samples", [](P& p) -> double& { return p.angle_lead_samples; }, kNotNegative},
      }));
}

}  // namespace drivebench::control
