#pragma once

#include <array>

#include "clients/control/gains/gain_rows.hpp"

namespace drivebench::control {

/// The rows of P.machine, a PmMachineModel, and of what every controller of one has.
template <class P>
constexpr auto pm_machine_rows() {
  constexpr GainRule kPositive = GainRule::kPositive;
  return joined(
      std::to_array<GainRow<P>>({
          {"machine.pole_pairs", [](P& p) -> double& { return p.machine.pole_pairs; }, kPositive},
          {"machine.resistance_ohm", [](P& p) -> double& { return p.machine.resistance_ohm; }, kPositive},
          {"machine.inductance_h", [](P& p) -> double& { return p.machine.inductance_h; }, kPositive},
          {"machine.torque_constant_nm_per_a",
           [](P& p) -> double& { return p.machine.torque_constant_nm_per_a; }, kPositive},
      }),
      shaft_and_sampling_rows<P>(), speed_observer_rows<P>(),
      std::to_array<GainRow<P>>({
          {"angle_lead_samples", [](P& p) -> double& { return p.angle_lead_samples; },
           GainRule::kNotNegative},
      }));
}

}  // namespace drivebench::control
