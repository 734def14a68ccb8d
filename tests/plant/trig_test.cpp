#include "plant/math/trig.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

namespace drivebench::trig_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kPi = 0x1.921fb54442d18p+1;
constexpr long double kHalfPi = 1.570796326794896619231321691639751442L;

/// Distance from the true value in units in the last place of the double nearest to it.
double ulps(double value, long double truth) {
  const double nearest = std::fabs(static_cast<double>(truth));
  if (nearest == 0.0) return value == 0.0 ? 0.0 : kInfinity;
  int exponent = 0;
  (void)std::frexp(nearest, &exponent);
  const long double ulp = std::ldexp(1.0L, std::max(exponent - 53, -1074));
  return static_cast<double>(std::fabs(static_cast<long double>(value) - truth) / ulp);
}

double cos_sin_ulps(double angle_rad) {
  const CosSin result = cos_sin(angle_rad);
  const auto angle = static_cast<long double>(angle_rad);
  return std::max(ulps(result.cos, std::cos(angle)), ulps(result.sin, std::sin(angle)));
}

/// Equal bits: tells -0 from 0, unlike ==.
::testing::AssertionResult same_bits(double actual, double expected) {
  if (std::bit_cast<std::uint64_t>(actual) == std::bit_cast<std::uint64_t>(expected)) {
    return ::testing::AssertionSuccess();
  }
  return ::testing::AssertionFailure() << std::hexfloat << actual << " is not " << expected;
}

// Catches: a wrong coefficient, a wrong part of pi/2, a reduction that forgets its low word.
TEST(Trig, SineAndCosineStayBelowOneUlpUpToAMillionRadians) {
  std::mt19937_64 engine(20250101);
  for (const double range_rad : {1e-8, 0.79, 3.2, 100.0, 1e4, 1e6, kLargestAngle_rad}) {
    std::uniform_real_distribution<double> angle(-range_rad, range_rad);
    double worst = 0.0;
    for (int i = 0; i < 100'000; ++i)
      worst = std::max(worst, cos_sin_ulps(angle(engine)));
    EXPECT_LT(worst, 0.85) << "range " << range_rad;  // 0.80 measured over 2.4e7 angles
  }
}

// Catches: a reduction with too few parts of pi/2: what cancels next to a multiple of pi/2 leaves no correct
// digits.
TEST(Trig, SineAndCosineStayBelowOneUlpNextToEveryMultipleOfHalfPi) {
  double worst = 0.0;
  for (int n = 1; n * kHalfPi < static_cast<long double>(kLargestAngle_rad) - 1.0L; n += 7) {
    const double angle_rad = static_cast<double>(n * kHalfPi);
    worst = std::max({worst, cos_sin_ulps(angle_rad), cos_sin_ulps(std::nextafter(angle_rad, 0.0)),
                      cos_sin_ulps(-std::nextafter(angle_rad, kInfinity))});
  }
  EXPECT_LT(worst, 0.85);
  // The double nearest to a multiple of pi/2 (n = 29) below the limit; value from 200-bit arithmetic.
  EXPECT_TRUE(same_bits(cosine(0x1.6c6cbc45dc8dep+5), -0x1.6d61b58c99c43p-61));
}

// Catches: a lost sign of zero, an underflow that turns a tiny angle's sine into zero.
TEST(Trig, SineOfTinyAnglesIsTheAngleWithItsSign) {
  for (const double tiny_rad : {0.0, 0x1p-1074, 0x1p-1022, 1e-200, 1e-9}) {
    EXPECT_TRUE(same_bits(sine(tiny_rad), tiny_rad));
    EXPECT_TRUE(same_bits(sine(-tiny_rad), -tiny_rad));
    EXPECT_TRUE(same_bits(cosine(-tiny_rad), 1.0));
  }
}

// Catches: a range check that lets NaN or infinity through to arithmetic whose NaN bits differ between
// processors.
TEST(Trig, AnglesBeyondTheRangeGiveTheQuietNan) {
  for (const double angle_rad : {std::nextafter(kLargestAngle_rad, kInfinity), 1e300, kInfinity, kNan}) {
    EXPECT_TRUE(same_bits(sine(angle_rad), kNan));
    EXPECT_TRUE(same_bits(cosine(-angle_rad), kNan));
  }
  EXPECT_TRUE(std::isfinite(sine(kLargestAngle_rad)));
  EXPECT_TRUE(std::isfinite(sine(-kLargestAngle_rad)));
}

// Catches: a wrong table entry, swapped quadrants, a missing part of the quotient.
TEST(Trig, Arctangent2StaysBelowTwoUlpInEveryQuadrant) {
  std::mt19937_64 engine(20250102);
  std::uniform_real_distribution<double> coordinate(-2.0, 2.0);
  std::uniform_int_distribution<int> exponent(-80, 80);
  double worst = 0.0;
  for (int i = 0; i < 400'000; ++i) {
    const double x = coordinate(engine);
    double y = coordinate(engine);
    if (i % 4 == 0) y = std::ldexp(y, exponent(engine));
    if (i % 4 == 1) y = std::ldexp(x, -(i / 4) % 8) * (1.0 + 0.02 * std::fabs(y));  // errors are largest here
    worst = std::max(
        worst, ulps(arctangent2(y, x), std::atan2(static_cast<long double>(y), static_cast<long double>(x))));
  }
  EXPECT_LT(worst, 1.6);  // 1.47 measured over 7e7 points
}

// Catches: overflow or underflow in the quotient or its correction.
TEST(Trig, Arctangent2IsRightAtTheEndsOfTheNumberRange) {
  for (const double y : {0x1p-1074, 1e-310, 2.3e-308, 3e-300, 0.5, 1e308, 1.79e308}) {
    for (const double x : {0x1p-1074, 1e-310, 2.3e-308, 3e-300, 0.5, 1e308, 1.79e308}) {
      const auto yl = static_cast<long double>(y);
      const auto xl = static_cast<long double>(x);
      EXPECT_LT(ulps(arctangent2(y, x), std::atan2(yl, xl)), 1.0) << y << ' ' << x;
      EXPECT_LT(ulps(arctangent2(-y, -x), std::atan2(-yl, -xl)), 1.0) << y << ' ' << x;
    }
  }
  // Whole numbers times the smallest and the largest unit: the angle is that of the numbers themselves.
  for (int y = 1; y < 100; ++y) {
    for (int x = 1; x < 100; ++x) {
      const double expected_rad = arctangent2(y, x);
      EXPECT_TRUE(same_bits(arctangent2(y * 0x1p-1074, x * 0x1p-1074), expected_rad)) << y << ' ' << x;
      EXPECT_TRUE(same_bits(arctangent2(y * 0x1p1017, x * 0x1p1017), expected_rad)) << y << ' ' << x;
    }
  }
}

// Catches: taking -0 for 0, NaN from 0/0 or infinity/infinity. Expected values are those of IEEE 754,
// section 9.2.1.
TEST(Trig, Arctangent2FollowsIeeeForZerosInfinitiesAndNan) {
  struct Case {
    double y;
    double x;
    double expected_rad;
  };
  constexpr double kQuarterPi = 0x1.921fb54442d18p-1;
  constexpr double kThreeQuarterPi = 0x1.2d97c7f3321d2p+1;
  for (const Case& c :
       {Case{0.0, 0.0, 0.0}, Case{0.0, -0.0, kPi}, Case{0.0, 1.0, 0.0}, Case{0.0, -1.0, kPi},
        Case{1.0, 0.0, kPi / 2}, Case{1.0, -0.0, kPi / 2}, Case{1.0, kInfinity, 0.0},
        Case{1.0, -kInfinity, kPi}, Case{kInfinity, 1.0, kPi / 2}, Case{kInfinity, -1.0, kPi / 2},
        Case{kInfinity, kInfinity, kQuarterPi}, Case{kInfinity, -kInfinity, kThreeQuarterPi},
        Case{0.0, kInfinity, 0.0}, Case{0.0, -kInfinity, kPi}, Case{kInfinity, 0.0, kPi / 2}}) {
    EXPECT_TRUE(same_bits(arctangent2(c.y, c.x), c.expected_rad)) << c.y << ' ' << c.x;
    EXPECT_TRUE(same_bits(arctangent2(-c.y, c.x), -c.expected_rad)) << -c.y << ' ' << c.x;
  }
  EXPECT_TRUE(std::isnan(arctangent2(kNan, 1.0)));
  EXPECT_TRUE(std::isnan(arctangent2(1.0, kNan)));
}

// Catches: a wrong coefficient, an exponent off by one at sqrt(1/2), cancellation next to 1.
TEST(Trig, LogarithmStaysBelowOneUlp) {
  std::mt19937_64 engine(20250103);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::uniform_int_distribution<int> exponent(-1080, 1000);
  double worst = 0.0;
  for (int i = 0; i < 100'000; ++i) {
    const double u = unit(engine) + 0x1p-54;
    for (const double x : {u, 0.5 + 1.5 * u, 1.0 + 1e-5 * (u - 0.5), std::ldexp(1.0 + u, exponent(engine))}) {
      if (x > 0.0) worst = std::max(worst, ulps(logarithm(x), std::log(static_cast<long double>(x))));
    }
  }
  EXPECT_LT(worst, 0.9);  // 0.84 measured over 1.5e7 arguments
}

// Catches: reading the exponent of a number that has no logarithm.
TEST(Trig, LogarithmTakesTheSpecialValues) {
  EXPECT_TRUE(same_bits(logarithm(1.0), 0.0));
  EXPECT_EQ(logarithm(0.0), -kInfinity);
  EXPECT_EQ(logarithm(-0.0), -kInfinity);
  EXPECT_EQ(logarithm(kInfinity), kInfinity);
  EXPECT_TRUE(same_bits(logarithm(-1.0), kNan));
  EXPECT_TRUE(same_bits(logarithm(kNan), kNan));
}

// Catches: a compiler, flag or processor that contracts, reorders or widens: the bits are part of the
// recording format.
TEST(Trig, GivesTheSameBitsOnEveryMachine) {
  struct Circle {
    double angle_rad;
    double cos;
    double sin;
  };
  for (const Circle& c : {Circle{0.5, 0x1.c1528065b7d5p-1, 0x1.eaee8744b05fp-2},
                          Circle{1.0, 0x1.14a280fb5068cp-1, 0x1.aed548f090ceep-1},
                          Circle{2.0, -0x1.aa22657537205p-2, 0x1.d18f6ead1b446p-1},
                          Circle{-3.5, -0x1.df77403c11a5fp-1, 0x1.6733b7eba621fp-2},
                          Circle{100.0, 0x1.b981dbf665fdfp-1, -0x1.03425b78c4db8p-1},
                          Circle{-12345.678, 0x1.6b94c3bbe24b8p-1, 0x1.687d5890974a5p-1},
                          Circle{999999.9, 0x1.cb54c8921878bp-1, -0x1.c45dd2caf2607p-2}}) {
    const CosSin both = cos_sin(c.angle_rad);
    EXPECT_TRUE(same_bits(both.cos, c.cos));
    EXPECT_TRUE(same_bits(both.sin, c.sin));
    EXPECT_TRUE(same_bits(cosine(c.angle_rad), c.cos));
    EXPECT_TRUE(same_bits(sine(c.angle_rad), c.sin));
  }
  EXPECT_TRUE(same_bits(arctangent2(0.3, 0.9), 0x1.4978fa3269ee1p-2));
  EXPECT_TRUE(same_bits(arctangent2(0.9, 0.3), 0x1.3fc176b7a856p+0));
  EXPECT_TRUE(same_bits(arctangent2(0.1, -0.8), 0x1.8234d7f6ecb9dp+1));
  EXPECT_TRUE(same_bits(arctangent2(-0.6, -0.5), -0x1.21fd09b1e712fp+1));
  EXPECT_TRUE(same_bits(logarithm(0.1), -0x1.26bb1bbb55515p+1));
  EXPECT_TRUE(same_bits(logarithm(0.70710678), -0x1.62e4300c77ae8p-2));
}

// Catches: the same as above, with enough arguments that a single fused operation in any branch shows.
TEST(Trig, AHashOfManyResultsIsTheSameOnEveryMachine) {
  std::uint64_t hash = 0;
  const auto add = [&hash](double value) {
    hash = (std::rotl(hash, 7) ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15U;
  };
  std::uint64_t state = 1;
  const auto draw = [&state] {  // [-1/2, 1/2), in the open, so that no library's distribution matters
    state = state * 6364136223846793005U + 1442695040888963407U;
    return static_cast<double>(state >> 11U) * 0x1p-53 - 0.5;
  };
  for (int i = 0; i < 100'000; ++i) {
    const double x = draw();
    const double y = draw();
    for (const double scale : {1.0, 10.0, 3.0e6}) {
      const CosSin both = cos_sin(scale * x);
      add(both.cos);
      add(both.sin);
      add(arctangent2(y, scale * x));
    }
    add(logarithm(std::fabs(y)));
  }
  EXPECT_EQ(hash, 0x3e67cdaf78a2ac67U);
}

}  // namespace
}  // namespace drivebench::trig_test
