#pragma once

#include <bit>
#include <cfloat>
#include <cstdint>
#include <limits>
#include <numbers>

#if defined(__FAST_MATH__) || FLT_EVAL_METHOD != 0
#error "trig.hpp needs plain IEEE double arithmetic: no -ffast-math, no x87"
#endif

/// Elementary functions that give the same bits on every machine, at every optimisation level, with every
/// compiler.
///
/// glibc picks its variant of sin, cos, atan2 and log by the CPU it finds at run time, so a recording made
/// with them does not replay bit for bit elsewhere. These use only + - * / in a fixed order, which IEEE 754
/// rounds in exactly one way; -ffp-contract=off keeps the compiler from fusing them. Default rounding mode
/// (to nearest) is assumed.
///
/// Errors against long double, measured by tests/plant/trig_test.cpp: sine and cosine below 0.8 ulp,
/// arctangent2 below 1.5 ulp, logarithm below 1 ulp.
namespace drivebench {

constexpr double kTurnRad = 2.0 * std::numbers::pi;

/// Cosine and sine of one angle. A rotation by that angle takes (1, 0) to (cos, sin).
struct CosSin {
  double cos;
  double sin;
};

/// Largest magnitude that sine, cosine and cos_sin accept: 2^20 quarter turns, a little less, so that the
/// number of quarter turns times each part of pi/2 stays exact. Beyond it, and for infinities and NaN, they
/// return a quiet NaN: an angle that big has lost its meaning (1 ulp is 0.2 nrad here and grows), and its
/// owner has forgotten to wrap it.
inline constexpr double kLargestAngle_rad = 1.6e6;

namespace trig_detail {

/// An angle less whole quarter turns: angle = quarter_turns · pi/2 + high + low, |high| <= pi/4 and a hair.
struct Reduced {
  double high;
  double low;
  std::uint64_t quarter_turns;  // modulo 2^51, only the last two bits are used
};

/// Cody-Waite reduction. pi/2 = kPart1 + kPart2 + kPart3 + kPart4; the first three have 33 bits, so n times
/// each is exact for |n| <= 2^20. The differences are exact (quick two-sum), down to the doubles that lie
/// nearest to a multiple of pi/2.
inline Reduced reduce(double angle_rad) noexcept {
  constexpr double kTwoOverPi = 0x1.45f306dc9c883p-1;
  constexpr double kPart1 = 0x1.921fb544p+0;
  constexpr double kPart2 = 0x1.0b4611a6p-34;
  constexpr double kPart3 = 0x1.3198a2ep-69;
  constexpr double kPart4 = 0x1.b839a252049c1p-104;
  // Adding 1.5 · 2^52 rounds to an integer and leaves it in the last bits: no conversion to int that could
  // overflow.
  constexpr double kShift = 0x1.8p52;
  const double shifted = angle_rad * kTwoOverPi + kShift;
  const double n = shifted - kShift;
  const double after1 = angle_rad - n * kPart1;
  const double take2 = n * kPart2;
  const double after2 = after1 - take2;
  const double take3 = n * kPart3;
  const double high = after2 - take3;
  const double low = ((after1 - after2) - take2) + (((after2 - high) - take3) - n * kPart4);
  return {.high = high, .low = low, .quarter_turns = std::bit_cast<std::uint64_t>(shifted)};
}

/// sin(x + low) for |x| <= pi/4. Minimax polynomial, relative error 2^-58; even and odd terms apart for
/// speed.
inline double sine_kernel(double x, double low) noexcept {
  const double z = x * x;
  const double z2 = z * z;
  const double even = 0x1.111111110f87ap-7 + z2 * (0x1.71de3577b6b87p-19 + z2 * 0x1.5d9300f673ba6p-33);
  const double odd = -0x1.a01a019c1199bp-13 + z2 * -0x1.ae5e663a8de6fp-26;
  const double tail = even + z * odd;
  const double cube = z * x;
  // Subtracting last keeps the sign of -0.
  return x - ((z * (0.5 * low - cube * tail) - low) - cube * -0x1.5555555555549p-3);
}

/// cos(x + low) for |x| <= pi/4. Minimax polynomial, relative error 2^-64; what rounding 1 - x²/2 loses is
/// added back.
inline double cosine_kernel(double x, double low) noexcept {
  const double z = x * x;
  const double z2 = z * z;
  const double even = 0x1.555555555554cp-5 + z2 * (0x1.a01a019cb1becp-16 + z2 * 0x1.1ee9ebe9b127p-29);
  const double odd = -0x1.6c16c16c1517ep-10 + z2 * (-0x1.27e4f809f164dp-22 + z2 * -0x1.8fae9cba30931p-37);
  const double half = 0.5 * z;
  const double head = 1.0 - half;
  return head + (((1.0 - head) - half) + (z2 * (even + z * odd) - x * low));
}

/// Bits of `value`, its sign flipped when bit 1 of `quarter_turns` is set, and kept when it is not.
inline std::uint64_t turned_bits(double value, std::uint64_t quarter_turns) noexcept {
  return std::bit_cast<std::uint64_t>(value) ^ ((quarter_turns & 2U) << 62U);
}

}  // namespace trig_detail

/// Cosine and sine of an angle in one go: the fast way when both are needed. |angle| <= kLargestAngle_rad,
/// else NaN.
inline CosSin cos_sin(double angle_rad) noexcept {
  if (!(angle_rad <= kLargestAngle_rad && angle_rad >= -kLargestAngle_rad)) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    return {.cos = kNan, .sin = kNan};
  }
  const trig_detail::Reduced reduced = trig_detail::reduce(angle_rad);
  const double c = trig_detail::cosine_kernel(reduced.high, reduced.low);
  const double s = trig_detail::sine_kernel(reduced.high, reduced.low);
  // The quadrant of a turning shaft is not predictable: choose with masks, not with branches.
  const std::uint64_t n = reduced.quarter_turns;
  const std::uint64_t cos_bits = trig_detail::turned_bits(c, n);
  const std::uint64_t sin_bits = trig_detail::turned_bits(s, n);
  const std::uint64_t minus_sin_bits = sin_bits ^ (std::uint64_t{1} << 63U);
  const std::uint64_t odd = std::uint64_t{0} - (n & 1U);
  return {.cos = std::bit_cast<double>((cos_bits & ~odd) | (minus_sin_bits & odd)),
          .sin = std::bit_cast<double>((sin_bits & ~odd) | (cos_bits & odd))};
}

/// Sine of an angle; sine(-0) is -0. |angle| <= kLargestAngle_rad, else NaN. Same bits as cos_sin().sin.
inline double sine(double angle_rad) noexcept {
  return cos_sin(angle_rad).sin;
}

/// Cosine of an angle. |angle| <= kLargestAngle_rad, else NaN. Same bits as cos_sin().cos.
inline double cosine(double angle_rad) noexcept {
  return cos_sin(angle_rad).cos;
}

/// Angle of the point (x, y) in [-pi, pi], all quadrants; zeros, their signs, and infinities as IEEE 754
/// says. NaN when either argument is NaN.
double arctangent2(double y, double x) noexcept;

/// Natural logarithm. Zero of either sign gives -infinity, a negative argument or NaN gives NaN, +infinity
/// itself.
double logarithm(double x) noexcept;

}  // namespace drivebench
