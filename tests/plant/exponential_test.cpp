#include "plant/math/exponential.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace drivebench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Distance from the true value in units in the last place of the double nearest to it.
double ulps(double x) {
  const long double truth = std::exp(static_cast<long double>(x));
  int exponent = 0;
  (void)std::frexp(static_cast<double>(truth), &exponent);
  const long double ulp = std::ldexp(1.0L, std::max(exponent - 53, -1074));
  return static_cast<double>(std::fabs(static_cast<long double>(exponential(x)) - truth) / ulp);
}

// Catches: a wrong coefficient, a reduction that forgets the low part of log 2, a quotient that is not
// rounded.
TEST(Exponential, StaysBelowOneUlp) {
  std::mt19937_64 engine(20250301);
  for (const double range : {1e-9, 0.35, 2.0, 40.0, 700.0}) {
    std::uniform_real_distribution<double> draw(-range, range);
    double worst = 0.0;
    for (int n = 0; n < 200'000; ++n)
      worst = std::max(worst, ulps(draw(engine)));
    EXPECT_LT(worst, 0.95) << "range " << range;  // 0.93 measured over 6e7 numbers
  }
}

// Catches: a power of two that wraps, a limit on the wrong side of the last representable result.
TEST(Exponential, OverflowsAndVanishesWhereDoublesEnd) {
  EXPECT_EQ(exponential(0.0), 1.0);
  EXPECT_EQ(exponential(-0.0), 1.0);
  EXPECT_LT(ulps(709.78), 1.0);
  EXPECT_EQ(exponential(709.7828), kInfinity);
  EXPECT_EQ(exponential(1e308), kInfinity);
  EXPECT_EQ(exponential(kInfinity), kInfinity);
  EXPECT_EQ(exponential(-kInfinity), 0.0);
  EXPECT_EQ(exponential(-746.0), 0.0);
  EXPECT_TRUE(std::isnan(exponential(std::numeric_limits<double>::quiet_NaN())));
  // Subnormal results are rounded twice: less than one and a half units.
  for (double x = -745.13; x < -708.0; x += 0.37)
    EXPECT_LT(ulps(x), 1.5) << x;
}

}  // namespace
}  // namespace drivebench
