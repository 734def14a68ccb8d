#pragma once

#include <algorithm>

#include "clients/control/loop/controller.hpp"
#include "clients/models/two_phase.hpp"

namespace drivebench::control {

/// The stator currents of a sample in two-phase quantities, of a star or of a two-phase machine.
inline PhasePair stator_currents(const Measurement& m, bool star) noexcept {
  return star ? two_phase_of(m.i_a_a, m.i_b_a, m.i_c_a) : PhasePair{.a = m.i_a_a, .b = m.i_b_a};
}

/// A two-phase quantity at the terminals of a star or of a two-phase machine.
inline Setpoint terminal_values(PhasePair x, bool star) noexcept {
  if (!star) return {.a = x.a, .b = x.b};
  const auto [a, b, c] = three_phases_of(x);
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
