#pragma once

#include <array>
#include <cstddef>

#include "clients/control/gains.hpp"

namespace drivebench::control {

/// The rows of P.machine, a PmMachineModel, and of what every controller of one has, followed by those that
/// only P has.
template <class P, std::size_t kOwn>
constexpr std::array<GainRow<P>, kOwn + 11> with_pm_machine_rows(const std::array<GainRow<P>, kOwn>& own) {
  constexpr GainRule kPositive = GainRule::kPositive;
  constexpr GainRule kNotNegative = GainRule::kNotNegative;
  std::array<GainRow<P>, kOwn + 11> rows{{
      {"machine.pole_pairs", [](P& p) -> double& { return p.machine.pole_pairs; }, kPositive},
      {"machine.resistance_ohm", [](P& p) -> double& { return p.machine.resistance_ohm; }, kPositive},
      {"machine.inductance_h", [](P& p) -> double& { return p.machine.inductance_h; }, kPositive},
      {"machine.torque_constant_nm_per_a", [](P& p) -> double& { return p.machine.torque_constant_nm_per_a; },
       kPositive},
      {"machine.friction_nms", [](P& p) -> double& { return p.machine.friction_nms; }, kNotNegative},
      {"machine.inertia_kgm2", [](P& p) -> double& { return p.machine.inertia_kgm2; }, kPositive},
      {"sample_rate_hz", [](P& p) -> double& { return p.sample_rate_hz; }, kPositive},
      {"counts_per_revolution", [](P& p) -> double& { return p.counts_per_revolution; }, kPositive},
      {"speed_observer.angle_per_s", [](P& p) -> double& { return p.speed_observer.angle_per_s; },
       kNotNegative},
      {"speed_observer.speed_per_s2", [](P& p) -> double& { return p.speed_observer.speed_per_s2; },
       kNotNegative},
      {"angle_lead_samples", [](P& p) -> double& { return p.angle_lead_samples; }, kNotNegative},
  }};
  for (std::size_t k = 0; k < kOwn; ++k)
    rows[11 + k] = own[k];
  return rows;
}

}  // namespace drivebench::control
