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

/// e^x = 2^n·(1 + rest).
struct Parts {
  double rest;  ///< in [-0.30, 0.42]
  std::int64_t n;
};

/// x = n·log 2 + r, |r| <= log(2)/2,   e^r = 1 + r + r²·Q(r),   Q(r) = sum of r^k/(k + 2)!, k = 0 .. 11
/// with even and odd terms apart for speed. The first omitted term is 2^-58. r is carried as high - low.
Parts parts_of(double x) noexcept {
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
  return {.rest = high + (z * (even + r * odd) - low), .n = static_cast<std::int64_t>(n)};
}

}  // namespace

double exponential(double x) noexcept {
  constexpr double kLargest = 709.79;    // beyond it the result exceeds every double
  constexpr double kSmallest = -745.14;  // below it the result is less than half of the smallest double
  if (!(x <= kLargest)) return x > 0.0 ? std::numeric_limits<double>::infinity() : x;
  if (x < kSmallest) return 0.0;
  const Parts parts = parts_of(x);
  // In two factors, since 2^n alone may be too large or too small for a normal number.
  const std::int64_t half = parts.n / 2;
  return (1.0 + parts.rest) * power_of_two(half) * power_of_two(parts.n - half);
}

double exponential_less_one(double x) noexcept {
  constexpr double kWhole = 38.0;  // e^x and 1 do not meet in 53 bits beyond it
  if (!(x <= kWhole)) return exponential(x);
  if (x < -kWhole) return -1.0;
  const Parts parts = parts_of(x);
  if (parts.n == 0) return x == 0.0 ? x : parts.rest;  // keeps the sign of -0
  const double scale = power_of_two(parts.n);
  return parts.n < 0 ? scale * parts.rest + (scale - 1.0)
                     : scale * (parts.rest + (1.0 - power_of_two(-parts.n)));
}

double power(double base, double exponent) noexcept {
  if (exponent == 0.0) return 1.0;
  return exponential(exponent * logarithm(base));
}

}  // namespace drivebench
