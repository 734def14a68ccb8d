#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/moves/move_of.hpp"

namespace drivebench::control {

/// Two constant speeds, one after the other, with a step between: shows how fast a drive can change its
/// speed.
struct SpeedStepsParameters {
  double first_rad_s;
  double first_s;  ///< duration of the first speed
  double second_rad_s;
  double second_s;

  static constexpr std::tuple kGains{
      gain("steps.first_rad_s", &SpeedStepsParameters::first_rad_s),
      gain("steps.first_s", &SpeedStepsParameters::first_s, GainRule::kDuration),
      gain("steps.second_rad_s", &SpeedStepsParameters::second_rad_s),
      gain("steps.second_s", &SpeedStepsParameters::second_s, GainRule::kDuration)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  Reference at(double t_s) const noexcept;
  double duration_s() const noexcept { return first_s + second_s; }
};

/// The angle is that of the speeds, the acceleration 0.
using SpeedSteps = MoveOf<SpeedStepsParameters>;

}  // namespace drivebench::control
