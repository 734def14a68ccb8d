#include "plant/math/trig.hpp"

#include <array>
#include <cmath>
#include <cstddef>

namespace drivebench {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A constant to twice the precision of a double: its value is high + low.
struct Wide {
  double high;
  double low;
};

constexpr Wide kPi{.high = 0x1.921fb54442d18p+1, .low = 0x1.1a62633145c07p-53};
constexpr Wide kHalfPi{.high = 0x1.921fb54442d18p+0, .low = 0x1.1a62633145c07p-54};

/// arctan(k/16).
constexpr std::array<Wide, 17> kArctangents{{{0.0, 0.0},
                                             {0x1.ff55bb72cfdeap-5, -0x1.c934d86d23f1dp-60},
                                             {0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59},
                                             {0x1.7b97b4bce5b02p-3, 0x1.347b0b4f881cap-58},
                                             {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
                                             {0x1.362773707ebccp-2, -0x1.963a544b672d8p-57},
                                             {0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56},
                                             {0x1.a64eec3cc23fdp-2, -0x1.24dec1b50b7ffp-56},
                                             {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                             {0x1.0657e94db30d0p-1, -0x1.d5b495f6349e6p-56},
                                             {0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58},
                                             {0x1.345f01cce37bbp-1, 0x1.1021137c71102p-55},
                                             {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
                                             {0x1.5d58987169b18p-1, 0x1.0028e4bc5e7cap-57},
                                             {0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56},
                                             {0x1.819d0b7158a4dp-1, -0x1.bf76229d3b917p-56},
                                             {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}}};

/// offset + sign · arctan(part/whole) for 0 <= part <= whole, whole well away from overflow and underflow:
/// the nearest sixteenth c from the table, and what is left, (part - c·whole)/(whole + c·part), at most 1/32,
/// by its power series (first omitted term 2^-63 of the result).
double offset_arctangent(Wide offset, double sign, double part, double whole) noexcept {
  const double ratio = part / whole;
  const int sixteenths = ratio < 3.0 / 32.0 ? 0 : static_cast<int>(ratio * 16.0 + 0.5);
  const double nearest = sixteenths * 0.0625;
  // c times each half of `whole` is exact, so the error of the quotient part/whole does not reach the result.
  constexpr std::uint64_t kUpperHalf = ~((std::uint64_t{1} << 27U) - 1U);
  const double upper = std::bit_cast<double>(std::bit_cast<std::uint64_t>(whole) & kUpperHalf);
  const double difference = (part - nearest * upper) - nearest * (whole - upper);
  const double rest = difference / (whole + nearest * part);
  const double z = rest * rest;
  const double z2 = z * z;
  const double even = -1.0 / 3.0 + z2 * (-1.0 / 7.0 + z2 * (-1.0 / 11.0 + z2 * (-1.0 / 15.0)));
  const double odd = 1.0 / 5.0 + z2 * (1.0 / 9.0 + z2 * (1.0 / 13.0));
  const double series = z * (even + z * odd);
  const Wide base = kArctangents[static_cast<std::size_t>(sixteenths)];
  const double big = offset.high + sign * base.high;
  const double lost = sign * base.high - (big - offset.high);  // exact: offset is 0 or the larger of the two
  // The small terms are added first, so that only the last sum rounds visibly.
  return big + (sign * rest + (sign * (rest * series + base.low) + (lost + offset.low)));
}

}  // namespace

double arctangent2(double y, double x) noexcept {
  if (std::isnan(x) || std::isnan(y)) return kNan;
  const bool steep = std::fabs(y) > std::fabs(x);
  double whole = steep ? std::fabs(y) : std::fabs(x);
  double part = steep ? std::fabs(x) : std::fabs(y);
  if (whole == 0.0) {
    whole = 1.0;  // the origin: IEEE 754 lets the sign of x = ±0 decide between 0 and pi
  } else if (whole == kInfinity) {
    part = part == kInfinity ? 1.0 : 0.0;  // two infinities are an odd multiple of pi/4
    whole = 1.0;
  } else if (whole > 0x1p1000 || whole < 0x1p-900) {
    const double scale = whole > 1.0 ? 0x1p-100 : 0x1p200;
    whole *= scale;
    part *= scale;
  }
  const bool backward = std::signbit(x);
  double angle_rad;
  if (steep) {
    angle_rad = offset_arctangent(kHalfPi, backward ? 1.0 : -1.0, part, whole);
  } else if (backward) {
    angle_rad = offset_arctangent(kPi, -1.0, part, whole);
  } else {
    angle_rad = offset_arctangent({.high = 0.0, .low = 0.0}, 1.0, part, whole);
  }
  return std::copysign(angle_rad, y);
}

/// x = 2^k · m, m in [sqrt(1/2), sqrt(2)), f = m - 1, s = f/(2 + f):
///   log(x) = k·log 2 + log((1 + s)/(1 - s)),   log((1 + s)/(1 - s)) = 2s + s·z·P(z),  z = s²
/// and 2s = f - f²/2 + s·f²/2, which keeps f exact where the result is small. P is minimax, relative error
/// 2^-59.
double logarithm(double x) noexcept {
  if (x == 0.0) return -kInfinity;
  if (!(x > 0.0)) return kNan;
  if (x == kInfinity) return x;
  int exponent = 0;
  if (x < std::numeric_limits<double>::min()) {
    x *= 0x1p54;
    exponent = -54;
  }
  // Shifting by the bits of sqrt(1/2) carries into the exponent exactly when the mantissa exceeds that of
  // sqrt(1/2).
  constexpr std::uint64_t kRootHalfBits = std::bit_cast<std::uint64_t>(0x1.6a09e667f3bcdp-1);
  constexpr std::uint64_t kMantissa = (std::uint64_t{1} << 52U) - 1U;
  constexpr int kRootHalfExponent = static_cast<int>(kRootHalfBits >> 52U);
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x) - (kRootHalfBits & kMantissa);
  exponent += static_cast<int>(bits >> 52U) - kRootHalfExponent;
  const std::uint64_t mantissa_bits = (bits & kMantissa) + kRootHalfBits;

  constexpr double kLog2High = 0x1.62e42fefa3p-1;  // 41 bits: exact times any exponent
  constexpr double kLog2Low = 0x1.3de6af278ece6p-42;
  const double f = std::bit_cast<double>(mantissa_bits) - 1.0;
  const double s = f / (2.0 + f);
  const double z = s * s;
  const double z2 = z * z;
  const double even = 0x1.5555555555593p-1 +
                      z2 * (0x1.24924942179f5p-2 + z2 * (0x1.7466462c21eb3p-3 + z2 * 0x1.2f0d8e4ff0addp-3));
  const double odd = 0x1.999999997fb31p-2 + z2 * (0x1.c71c51e7f9862p-3 + z2 * 0x1.39a0f50b7073fp-3);
  const double series = z * (even + z * odd);
  const double half_square = 0.5 * f * f;
  return exponent * kLog2High - ((half_square - (s * (half_square + series) + exponent * kLog2Low)) - f);
}

}  // namespace drivebench
