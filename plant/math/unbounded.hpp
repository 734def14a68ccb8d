#pragma once

#include <cmath>

#include "plant/math/trig.hpp"

namespace drivebench {

/// Cosine and sine of an angle that is never wrapped, such as that of a shaft that turns for days. Beyond
/// kLargestAngle_rad whole turns are taken off first, exactly but for kTurnRad itself: that misses at most
/// 4e-17 of the angle, less than its last bit. NaN for infinities and NaN.
inline CosSin cos_sin_unbounded(double angle_rad) noexcept {
  const bool is_large = angle_rad > kLargestAngle_rad || angle_rad < -kLargestAngle_rad;
  return cos_sin(is_large ? std::remainder(angle_rad, kTurnRad) : angle_rad);
}

}  // namespace drivebench
