#pragma once

#include <array>
#include <numbers>

namespace drivebench {

/// A two-phase quantity in the stator frame, phases a and b in quadrature.
struct PhasePair {
  double a;
  double b;
};

/// Three phases of a star to their two-phase equivalent, power-invariant; the zero sequence drops out:
///   x_a = √(2/3)·(x_1 − x_2/2 − x_3/2)        x_b = (x_2 − x_3)/√2
/// Source: the book, section 7.1 (P3-02).
constexpr PhasePair two_phase_of(double x1, double x2, double x3) noexcept {
  constexpr double kRootTwoThirds = std::numbers::sqrt2 * std::numbers::inv_sqrt3;
  return {.a = kRootTwoThirds * (x1 - 0.5 * (x2 + x3)), .b = (x2 - x3) / std::numbers::sqrt2};
}

/// The inverse, with zero sequence zero.
constexpr std::array<double, 3> three_phases_of(PhasePair x) noexcept {
  constexpr double kRootTwoThirds = std::numbers::sqrt2 * std::numbers::inv_sqrt3;
  const double first = kRootTwoThirds * x.a;
  const double across = x.b / std::numbers::sqrt2;
  return {first, across - 0.5 * first, -0.5 * first - across};
}

}  // namespace drivebench
