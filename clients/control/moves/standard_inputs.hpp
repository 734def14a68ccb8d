#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/moves/move_of.hpp"

/// References that no machine can follow or that are followed for ever: what loops are tested with.
namespace drivebench::control {

/// The angle jumps at time 0 and goes on at constant speed.
struct StepMoveParameters {
  double distance_rad;
  double speed_rad_s;
  double duration_s;

  static constexpr std::tuple kGains{
      gain("move.distance_rad", &StepMoveParameters::distance_rad),
      gain("move.speed_rad_s", &StepMoveParameters::speed_rad_s),
      gain("move.duration_s", &StepMoveParameters::duration_s, GainRule::kDuration)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  Reference at(double t_s) const noexcept;
};

using StepMove = MoveOf<StepMoveParameters>;

/// The angle of a sine from time 0 on, θ = A·sin(Ωt): its speed jumps there.
struct SineMoveParameters {
  double amplitude_rad;
  double angular_frequency_rad_s;
  double duration_s;

  static constexpr std::tuple kGains{
      gain("move.amplitude_rad", &SineMoveParameters::amplitude_rad),
      gain("move.angular_frequency_rad_s", &SineMoveParameters::angular_frequency_rad_s, GainRule::kPositive),
      gain("move.duration_s", &SineMoveParameters::duration_s, GainRule::kDuration)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  Reference at(double t_s) const noexcept;
};

using SineMove = MoveOf<SineMoveParameters>;

/// The motion that a sinusoidal torque makes of a shaft at rest with friction: α + (f/J)·ω = A·sin(Ωt). A
/// controller that works out the current of the reference gets the sine back.
struct SineTorqueMoveParameters {
  double amplitude_rad_s2;         ///< A: torque over inertia
  double angular_frequency_rad_s;  ///< Ω
  double friction_rate_per_s;      ///< f/J
  double duration_s;

  static constexpr std::tuple kGains{
      gain("move.amplitude_rad_s2", &SineTorqueMoveParameters::amplitude_rad_s2),
      gain("move.angular_frequency_rad_s", &SineTorqueMoveParameters::angular_frequency_rad_s,
           GainRule::kPositive),
      gain("move.friction_rate_per_s", &SineTorqueMoveParameters::friction_rate_per_s,
           GainRule::kNotNegative),
      gain("move.duration_s", &SineTorqueMoveParameters::duration_s, GainRule::kDuration)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  Reference at(double t_s) const noexcept;
};

using SineTorqueMove = MoveOf<SineTorqueMoveParameters>;

}  // namespace drivebench::control
