#pragma once

#include <algorithm>

#include "clients/control/loop/controller.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// The stator currents of a sample in two-phase quantities, of a star or of a two-phase machine.
inline TwoPhase stator_currents(const Measurement& m, bool star) noexcept {
  return star ? three_to_two({.a = m.i_a_a, .b = m.i_b_a, .c = m.i_c_a})
              : TwoPhase{.a = m.i_a_a, .b = m.i_b_a};
}

/// A two-phase quantity at the terminals of a star or of a two-phase machine.
inline Setpoint terminal_values(TwoPhase x, bool star) noexcept {
  if (!star) return {.a = x.a, .b = x.b};
  const auto [a, b, c] = two_to_three(x);
  return {.a = a, .b = b, .c = c};
}

/// Each phase within plus and minus the limit, as in an amplifier; the field is unchanged.
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
