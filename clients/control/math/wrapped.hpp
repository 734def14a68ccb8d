#pragma once

#include <cmath>

#include "plant/math/trig.hpp"

namespace drivebench::control {

/// Wraps an angle to (−π, π].
inline double wrapped(double angle_rad) noexcept {
  return angle_rad - kTurnRad * std::ceil(angle_rad / kTurnRad - 0.5);
}

}  // namespace drivebench::control
