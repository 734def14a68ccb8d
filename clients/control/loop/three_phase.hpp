#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/control/loop/controller.hpp"
#include "clients/control/math/frames.hpp"

namespace drivebench::control {

/// Three phases of a star to their two-phase equivalent, power-invariant:
///   x_a = √(2/3)·(x_1 − x_2/2 − x_3/2)        x_b = (x_2 − x_3)/√2
/// Source: Chiasson 2005, section 7.1 (P3-02).
inline PhasePair two_phase_of(double x1, double x2, double x3) noexcept {
  constexpr double kRootTwoThirds = std::numbers::sqrt2 * std::numbers::inv_sqrt3;
  return {.a = kRootTwoThirds * (x1 - 0.5 * (x2 + x3)), .b = (x2 - x3) / std::numbers::sqrt2};
}

/// The stator currents of a sample in two-phase quantities, of a star or of a two-phase machine.
inline PhasePair stator_currents(const Measurement& m, bool star) noexcept {
  return star ? two_phase_of(m.i_a_a, m.i_b_a, m.i_c_a) : PhasePair{.a = m.i_a_a, .b = m.i_b_a};
}

/// A two-phase quantity at the terminals: the inverse, with zero sequence zero.
inline Setpoint terminal_values(PhasePair x, bool star) noexcept {
  if (!star) return {.a = x.a, .b = x.b};
  constexpr double kRootTwoThirds = std::numbers::sqrt2 * std::numbers::inv_sqrt3;
  const double first = kRootTwoThirds * x.a;
  const double across = x.b / std::numbers::sqrt2;
  return {.a = first, .b = across - 0.5 * first, .c = -0.5 * first - across};
}

/// Each phase within plus and minus the limit, as an amplifier does it; the field is left as it is.
inline Setpoint clipped(const Setpoint& x, double limit) noexcept {
  return {.a = std::clamp(x.a, -limit, limit),
          .b = std::clamp(x.b, -limit, limit),
          .c = std::clamp(x.c, -limit, limit),
          .field = x.field};
}

inline bool same_phases(const Setpoint& x, const Setpoint& y) noexcept {
  return x.a == y.a && x.b == y.b && x.c == y.c;
}

}  // namespace drivebench::control
