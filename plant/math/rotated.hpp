#pragma once

#include "plant/math/trig.hpp"

namespace drivebench {

/// Cosine and sine of an angle a little further on: `start` rotated by `by_rad`, by the first terms of their
/// series. Error |by|^8/40320: 9e-12 for 0.16 rad, 1e-7 for 0.5 rad, well below that of the Runge-Kutta step
/// whose stages need it.
///
/// With it each stage sees the electrical angle of its own, at the price of a cos_sin() now and then. Cosine
/// and sine carried as states of the step (c' = -n_p w s, s' = n_p w c) cost more and leave 20 to 140 times
/// the error: the step shrinks them and turns them a little too slowly.
constexpr CosSin rotated(CosSin start, double by_rad) noexcept {
  const double z = by_rad * by_rad;
  const double cos = 1.0 - z * (1.0 / 2.0 - z * (1.0 / 24.0 - z * (1.0 / 720.0)));
  const double sin = by_rad - by_rad * z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0)));
  return {.cos = start.cos * cos - start.sin * sin, .sin = start.sin * cos + start.cos * sin};
}

}  // namespace drivebench
