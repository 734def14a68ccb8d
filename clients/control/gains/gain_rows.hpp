#pragma once

#include <array>
#include <cstddef>

#include "clients/control/gains/gains.hpp"

// Rows that many parameter structs have, by the names of their members.
namespace drivebench::control {

/// One table out of several.
template <class P, std::size_t... kRows>
constexpr auto joined(const std::array<GainRow<P>, kRows>&... parts) {
  std::array<GainRow<P>, (kRows + ...)> all{};
  std::size_t next = 0;
  const auto append = [&](const auto& part) {
    for (const GainRow<P>& row : part)
      all[next++] = row;
  };
  (append(parts), ...);
  return all;
}

/// Of P.machine's shaft, and of what P is sampled with.
template <class P>
constexpr std::array<GainRow<P>, 4> shaft_and_sampling_rows() {
  constexpr GainRule kPositive = GainRule::kPositive;
  return {{{"machine.friction_nms", [](P& p) -> double& { return p.machine.friction_nms; },
            GainRule::kNotNegative},
           {"machine.inertia_kgm2", [](P& p) -> double& { return p.machine.inertia_kgm2; }, kPositive},
           {"sample_rate_hz", [](P& p) -> double& { return p.sample_rate_hz; }, kPositive},
           {"counts_per_revolution", [](P& p) -> double& { return p.counts_per_revolution; }, kPositive}}};
}

/// Of P.position, ServoGains.
template <class P>
constexpr std::array<GainRow<P>, 3> position_rows() {
  return {{{"position.integral_per_s3", [](P& p) -> double& { return p.position.integral_per_s3; },
            GainRule::kNotNegative},
           {"position.proportional_per_s2", [](P& p) -> double& { return p.position.proportional_per_s2; },
            GainRule::kNotNegative},
           {"position.derivative_per_s", [](P& p) -> double& { return p.position.derivative_per_s; },
            GainRule::kNotNegative}}};
}

/// Of P.current, CurrentLoopGains.
template <class P>
constexpr std::array<GainRow<P>, 2> current_rows() {
  return {{{"current.proportional_v_per_a", [](P& p) -> double& { return p.current.proportional_v_per_a; },
            GainRule::kNotNegative},
           {"current.integral_v_per_as", [](P& p) -> double& { return p.current.integral_v_per_as; },
            GainRule::kNotNegative}}};
}

/// Of P.flux, FluxGains.
template <class P>
constexpr std::array<GainRow<P>, 2> flux_rows() {
  return {{{"flux.proportional_a_per_wb", [](P& p) -> double& { return p.flux.proportional_a_per_wb; },
            GainRule::kNotNegative},
           {"flux.integral_a_per_wbs", [](P& p) -> double& { return p.flux.integral_a_per_wbs; },
            GainRule::kNotNegative}}};
}

/// Of P.speed_observer, SpeedObserverGains.
template <class P>
constexpr std::array<GainRow<P>, 2> speed_observer_rows() {
  return {{{"speed_observer.angle_per_s", [](P& p) -> double& { return p.speed_observer.angle_per_s; },
            GainRule::kNotNegative},
           {"speed_observer.speed_per_s2", [](P& p) -> double& { return p.speed_observer.speed_per_s2; },
            GainRule::kNotNegative}}};
}

}  // namespace drivebench::control
