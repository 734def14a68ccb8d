#include "plant/math/phasor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace drivebench::phasor_test {
namespace {

using Complex = std::complex<double>;
using Exact = std::complex<long double>;

/// |error| in units of 2^-53 of the value.
double error(Complex value, Exact truth) {
  return static_cast<double>(std::abs(Exact(value) - truth) / std::abs(truth) * 0x1p53L);
}

// Catches: a product in the place of a square, a sum of lengths.
TEST(Phasor, LengthIsRightOverTheValuesOfADrive) {
  std::mt19937_64 engine(20250401);
  std::uniform_real_distribution<double> draw(-1e3, 1e3);
  double worst = 0.0;
  for (int n = 0; n < 50'000; ++n) {
    const double x = draw(engine);
    const double y = std::ldexp(draw(engine), n % 60 - 30);
    worst = std::max(worst, error(length(x, y), std::hypot(static_cast<long double>(x), y)));
  }
  EXPECT_LT(worst, 2.0);  // two roundings of the squares and the sum, halved by the root, and one of the root
  EXPECT_EQ(length(3.0, -4.0), 5.0);
  EXPECT_EQ(length(-0.0, 0.0), 0.0);
  EXPECT_TRUE(std::isnan(length(1.0, std::numeric_limits<double>::quiet_NaN())));
}

// Catches: cosine and sine in the wrong order, a quotient by |y| in the place of |y|^2, a conjugate
// forgotten.
TEST(Phasor, PolarFormAndQuotientAgreeWithLongDouble) {
  std::mt19937_64 engine(20250402);
  std::uniform_real_distribution<double> draw(-10.0, 10.0);
  double worst_quotient = 0.0;
  double worst_phasor = 0.0;
  for (int n = 0; n < 50'000; ++n) {
    const Complex x(draw(engine), draw(engine));
    const Complex y(draw(engine), draw(engine));
    worst_quotient = std::max(worst_quotient, error(quotient(x, y), Exact(x) / Exact(y)));
    worst_phasor =
        std::max(worst_phasor, error(phasor(argument(x), magnitude(x)), Exact(x)) / (1.0 + std::numbers::pi));
  }
  EXPECT_LT(worst_quotient, 5.0);  // 4.1 measured over 3e6 pairs
  EXPECT_LT(worst_phasor, 2.0);    // the last bit of an angle of pi is 4 units
}

// Catches: NaN once a shaft has turned for an hour, a step of the angle where the reduction begins.
TEST(Phasor, AnUnboundedAngleIsRightToItsLastBit) {
  std::mt19937_64 engine(20250403);
  for (const double range_rad : {1.0, kLargestAngle_rad, 1.01 * kLargestAngle_rad, 1e9, 1e12}) {
    std::uniform_real_distribution<double> draw(-range_rad, range_rad);
    for (int n = 0; n < 20'000; ++n) {
      const double angle_rad = draw(engine);
      const CosSin at = cos_sin_unbounded(angle_rad);
      const double tolerance = 2e-16 + 5e-17 * std::fabs(angle_rad);
      EXPECT_NEAR(at.cos, static_cast<double>(std::cos(static_cast<long double>(angle_rad))), tolerance);
      EXPECT_NEAR(at.sin, static_cast<double>(std::sin(static_cast<long double>(angle_rad))), tolerance);
    }
  }
  EXPECT_TRUE(std::isnan(cos_sin_unbounded(std::numeric_limits<double>::infinity()).cos));
  EXPECT_TRUE(std::isnan(cos_sin_unbounded(std::numeric_limits<double>::quiet_NaN()).sin));
}

}  // namespace
}  // namespace drivebench::phasor_test
