#pragma once

#include <cmath>
#include <numbers>

#include "clients/models/two_phase.hpp"

namespace drivebench::control {

/// A two-phase quantity along (d) and across (q) a direction, usually the rotor flux.
struct DirectQuadrature {
  double d;
  double q;
};

/// The direction of a frame, its cosine and sine taken once and used for both transforms of a sample.
struct Direction {
  double cosine;
  double sine;

  static Direction at(double angle_rad) noexcept { return {std::cos(angle_rad), std::sin(angle_rad)}; }
  DirectQuadrature to_dq(PhasePair x) const noexcept {
    return {.d = cosine * x.a + sine * x.b, .q = cosine * x.b - sine * x.a};
  }
  PhasePair to_ab(DirectQuadrature x) const noexcept {
    return {.a = cosine * x.d - sine * x.q, .b = sine * x.d + cosine * x.q};
  }
};

/// Wraps an angle to (−π, π].
inline double wrapped(double angle_rad) noexcept {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  return angle_rad - kTurn * std::ceil(angle_rad / kTurn - 0.5);
}

}  // namespace drivebench::control
