#pragma once

#include "plant/windings.hpp"

namespace drivebench {

/// f applied to each phase of its arguments, which may be ThreePhase or PhaseValues. Written out rather than
/// looped: the compilers keep the values in registers.
template <class F, class... Values>
constexpr ThreePhase by_phase(const F& f, const Values&... x) noexcept {
  return {.a = f(x.a...), .b = f(x.b...), .c = f(x.c...)};
}

/// f applied to each phase and to the field.
template <class F, class... Values>
constexpr PhaseValues by_terminal(const F& f, const Values&... x) noexcept {
  return {.a = f(x.a...), .b = f(x.b...), .c = f(x.c...), .field = f(x.field...)};
}

/// Without the field.
constexpr ThreePhase phases_of(const PhaseValues& x) noexcept {
  return {.a = x.a, .b = x.b, .c = x.c};
}

/// The phases that exist; the others zero.
constexpr ThreePhase existing(const ThreePhase& x, int terminals) noexcept {
  return {.a = x.a, .b = terminals > 1 ? x.b : 0.0, .c = terminals > 2 ? x.c : 0.0};
}

constexpr double& phase(ThreePhase& x, int k) noexcept {
  return k == 0 ? x.a : (k == 1 ? x.b : x.c);
}

}  // namespace drivebench
