#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "clients/control/moves/move_of.hpp"

namespace drivebench::control {

/// From rest to a speed on a smooth ramp, and on with it.
struct SpeedRampParameters {
  double speed_rad_s;  ///< signed
  double ramp_s;
  double cruise_s;  ///< may be 0

  static constexpr std::tuple kGains{gain("move.speed_rad_s", &SpeedRampParameters::speed_rad_s),
                                     gain("move.ramp_s", &SpeedRampParameters::ramp_s, GainRule::kDuration),
                                     gain("move.cruise_s", &SpeedRampParameters::cruise_s, GainRule::kPause)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  Reference at(double t_s) const noexcept;
  double duration_s() const noexcept { return ramp_s + cruise_s; }
};

using SpeedRamp = MoveOf<SpeedRampParameters>;

}  // namespace drivebench::control
