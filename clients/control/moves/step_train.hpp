#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/moves/move_of.hpp"

namespace drivebench::control {

/// A train of equal steps of the angle, the first at time 0: what a stepping motor is given open-loop.
struct StepTrainParameters {
  double step_rad;  ///< signed
  double steps;     ///< a whole number
  double rate_hz;

  static constexpr std::tuple kGains{
      gain("train.step_rad", &StepTrainParameters::step_rad),
      gain("train.steps", &StepTrainParameters::steps, GainRule::kPositive),
      gain("train.rate_hz", &StepTrainParameters::rate_hz, GainRule::kPositive)};
  std::vector<std::string> problems() const;

  Reference at(double t_s) const noexcept;
  double duration_s() const noexcept { return steps / rate_hz; }
};

/// The angle jumps; speed and acceleration are 0. The last step lasts as long as the others.
using StepTrain = MoveOf<StepTrainParameters>;

}  // namespace drivebench::control
