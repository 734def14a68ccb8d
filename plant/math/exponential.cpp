#include "plant/math/exponential.hpp"

#include <bit>
#include <cstdint>
#include <limits>

#include "plant/math/trig.hpp"  // refuses compilers that do not compute as IEEE 754 says

namespace drivebench {
namespace {

/// 2^n for a normal result.
double power_of_two(std::int64_t n) noexcept {
  return std::bit_cast<double>(static_cast<std::uint64_t>(n + 1023) << 52U);
}

}  // namespace

/// x = n·log 2 + r, |r| <= log(2)/2,   e^r = 1 + r + r²·Q(r),   Q(r) = sum of r^k/(k + 2)!, k = 0 .. 11
/// with even and odd terms apart for speed. The first omitted term is 2^-58. r is carried as high - low.
double exponential(double x) noexcept {
  constexpr double kLargest = 709.79;    // beyond it the result exceeds every double
  constexpr double kSmallest = -745.14;  // below it the result is less than half of the smallest double
  if (!(x <= kLargest)) return x > 0.0 ? std::numeric_limits<double>::infinity() : x;
  if (x < kSmallest) return 0.0;

  constexpr double kLog2High = 0x1.62e42fefa3p-1;  // 41 bits: exact times any exponent
  constexpr double kLog2Low = 0x1.3de6af278ece6p-42;
  constexpr double kShift = 0x1.8p52;  // adding it rounds to an integer
  const double n = (x * 0x1.71547652b82fep+0 + kShift) - kShift;
  const double high = x - n * kLog2High;
  const double low = n * kLog2Low;
  const double r = high - low;

  const double z = r * r;
  const double even =
      1.0 / 2.0 +
      z * (1.0 / 24.0 +
           z * (1.0 / 720.0 + z * (1.0 / 40320.0 + z * (1.0 / 3628800.0 + z * (1.0 / 479001600.0)))));
  const double odd =
      1.0 / 6.0 +
      z * (1.0 / 120.0 +
           z * (1.0 / 5040.0 + z * (1.0 / 362880.0 + z * (1.0 / 39916800.0 + z * (1.0 / 6227020800.0)))));
  const double value = 1.0 + (high + (z * (even + r * odd) - low));

  // In two factors, since 2^n alone may be too large or too small for a normal number.
  const auto whole = static_cast<std::int64_t>(n);
  const std::int64_t half = whole / 2;
  return value * power_of_two(half) * power_of_two(whole - half);
}

}  // namespace drivebench
