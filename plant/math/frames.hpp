#pragma once

#include "plant/math/trig.hpp"

/// Reference frames: three phases, their two-phase equivalent, and frames that turn.
///
/// The three-to-two transform is the power-invariant one (the orthogonal matrix with factor sqrt(2/3)): the
/// two-phase power u_a·i_a + u_b·i_b is the three-phase power less that of the zero sequence, with no factor
/// 3/2. The price is that the amplitude of a balanced set grows by sqrt(3/2): 208 V rms line to line is
/// 169.83 V phase peak and 208.00 V two-phase peak. Limits of a phase are therefore tested on three-phase
/// quantities, never on two-phase ones.
///
/// Rotation is positive from phase a to phase b (to phase c). Source: the book, section 7.1; tags P3-02,
/// P3-03.
namespace drivebench {

/// Per-phase quantities (voltages to any common point, or currents).
struct ThreePhase {
  double a;
  double b;
  double c;
};

/// Two-phase equivalent in the stator frame; phase b is a quarter turn (electrical) ahead of phase a.
struct TwoPhase {
  double a;
  double b;
};

/// Components along (d) and a quarter turn ahead of (q) the axis of a turning frame.
struct Dq {
  double d;
  double q;
};

namespace frames_detail {
inline constexpr double kRootTwoThirds = 0x1.a20bd700c2c3ep-1;  // sqrt(2/3)
inline constexpr double kRootHalf = 0x1.6a09e667f3bcdp-1;       // sqrt(1/2)
inline constexpr double kRootThird = 0x1.279a74590331cp-1;      // sqrt(1/3)
}  // namespace frames_detail

/// Mean of the phases: of voltages to a common point, the voltage of an isolated motor neutral to that point.
/// The zero sequence of the power-invariant transform is sqrt(3) times it.
constexpr double neutral(ThreePhase x) noexcept {
  return (x.a + x.b + x.c) / 3.0;
}

/// Phases less their mean: the voltages that an isolated star sees, which always sum to zero.
constexpr ThreePhase without_neutral(ThreePhase x) noexcept {
  const double mean = neutral(x);
  return {.a = x.a - mean, .b = x.b - mean, .c = x.c - mean};
}

/// x_a = sqrt(2/3)·(x_1 − x_2/2 − x_3/2),   x_b = sqrt(1/2)·(x_2 − x_3);   the zero sequence is dropped.
constexpr TwoPhase three_to_two(ThreePhase x) noexcept {
  return {.a = frames_detail::kRootTwoThirds * (x.a - 0.5 * (x.b + x.c)),
          .b = frames_detail::kRootHalf * (x.b - x.c)};
}

/// The inverse, with zero sequence zero: x_1 = sqrt(2/3)·x_a,   x_2,3 = −x_1/2 ± sqrt(1/2)·x_b.
constexpr ThreePhase two_to_three(TwoPhase x) noexcept {
  const double first = frames_detail::kRootTwoThirds * x.a;
  const double across = frames_detail::kRootHalf * x.b;
  return {.a = first, .b = across - 0.5 * first, .c = -0.5 * first - across};
}

/// Stator frame to a frame at the given electrical angle, counted positive from phase a to phase b:
///   x_d = x_a·cos + x_b·sin,   x_q = −x_a·sin + x_b·cos
/// The angle decides the name of the frame. dq: the angle of the flux the frame follows (the rotor flux of an
/// induction machine, the magnet of a PM machine). xy: the rotor's electrical angle n_p·theta; for an
/// induction machine this rotor frame is not dq, and its x and y are the members d and q here. For a PM
/// machine the two are one.
constexpr Dq to_dq(TwoPhase x, CosSin angle) noexcept {
  return {.d = x.a * angle.cos + x.b * angle.sin, .q = x.b * angle.cos - x.a * angle.sin};
}

/// The inverse rotation, back to the stator frame: x_a = x_d·cos − x_q·sin,   x_b = x_d·sin + x_q·cos.
constexpr TwoPhase to_ab(Dq x, CosSin angle) noexcept {
  return {.a = x.d * angle.cos - x.q * angle.sin, .b = x.d * angle.sin + x.q * angle.cos};
}

}  // namespace drivebench
