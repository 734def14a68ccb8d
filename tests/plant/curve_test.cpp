#include "plant/math/curve.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace drivebench::curve_test {
namespace {

const std::vector<CurvePoint> kPoints{{1.0, 2.0}, {2.0, 4.0}, {4.0, 5.0}, {8.0, 5.5}};

// Numbers small enough for exact arithmetic. Catches: the segment left of a point for that right of it, an
// end that is held where the line must go on.
TEST(Curve, GivesValueAndSlopeBetweenAndBeyondItsPoints) {
  const Curve curve(kPoints);
  EXPECT_EQ(curve.value(1.0), 2.0);
  EXPECT_EQ(curve.value(1.5), 3.0);
  EXPECT_EQ(curve.value(2.0), 4.0);
  EXPECT_EQ(curve.value(3.0), 4.5);
  EXPECT_EQ(curve.value(8.0), 5.5);
  EXPECT_EQ(curve.value(0.0), 0.0);
  EXPECT_EQ(curve.value(16.0), 6.5);
  EXPECT_EQ(curve.slope(0.0), 2.0);
  EXPECT_EQ(curve.slope(1.0), 2.0);
  EXPECT_EQ(curve.slope(2.0), 0.5);
  EXPECT_EQ(curve.slope(3.9), 0.5);
  EXPECT_EQ(curve.slope(4.0), 0.125);
  EXPECT_EQ(curve.slope(8.0), 0.125);
  EXPECT_EQ(curve.slope(100.0), 0.125);
}

// Catches: held() that goes on beyond an end, or that starts to hold too early.
TEST(Curve, HeldKeepsTheValuesOfTheEnds) {
  const Curve curve(kPoints);
  EXPECT_EQ(curve.held(-5.0), 2.0);
  EXPECT_EQ(curve.held(1.0), 2.0);
  EXPECT_EQ(curve.held(3.0), 4.5);
  EXPECT_EQ(curve.held(8.0), 5.5);
  EXPECT_EQ(curve.held(9.0), 5.5);
}

// Catches: an inverse that looks for x among the y, one that forgets the added slope in the search or in the
// segment. Tolerance: a few roundings of numbers below 100.
TEST(Curve, InverseUndoesValueAlsoWithAnAddedSlope) {
  const Curve curve(kPoints);
  std::mt19937_64 engine(31);
  std::uniform_real_distribution<double> draw(-10.0, 20.0);
  for (int n = 0; n < 1000; ++n) {
    const double x = draw(engine);
    EXPECT_NEAR(curve.inverse(curve.value(x)), x, 1e-12);
    EXPECT_NEAR(curve.inverse(curve.value(x) + 0.75 * x, 0.75), x, 1e-12);
  }
}

// Catches: a wrong factor of the triangle, an area that is not summed over the segments, one that forgets the
// area before the first point.
TEST(Curve, AreaIsTheIntegralFromTheFirstPoint) {
  const Curve curve(kPoints);
  EXPECT_EQ(curve.area(1.0), 0.0);
  EXPECT_EQ(curve.area(2.0), 3.0);
  EXPECT_EQ(curve.area(3.0), 3.0 + 4.25);
  EXPECT_EQ(curve.area(4.0), 3.0 + 9.0);
  EXPECT_EQ(curve.area(8.0), 3.0 + 9.0 + 21.0);
  EXPECT_EQ(curve.area(16.0), 33.0 + 48.0);
  EXPECT_EQ(curve.area(0.0), -1.0);
  // Its slope is the curve: a central difference of a quadratic is exact but for rounding, 1e-16 x 100/1e-4.
  for (const double x : {-1.0, 1.3, 2.5, 6.0, 11.0})
    EXPECT_NEAR((curve.area(x + 1e-4) - curve.area(x - 1e-4)) / 2e-4, curve.value(x), 1e-9);
}

// Catches: an empty curve that is read.
TEST(Curve, WithoutPointsIsZeroEverywhere) {
  const Curve curve;
  EXPECT_TRUE(curve.empty());
  EXPECT_TRUE(curve.points().empty());
  EXPECT_EQ(curve.held(3.0), 0.0);
  EXPECT_EQ(curve.value(3.0), 0.0);
  EXPECT_EQ(curve.slope(3.0), 0.0);
  EXPECT_EQ(curve.inverse(3.0), 0.0);
  EXPECT_EQ(curve.area(3.0), 0.0);
}

// Catches: a copy that allocates a table of its own: parameters are copied while the bench runs.
TEST(Curve, CopiesShareTheirPoints) {
  const Curve curve(kPoints);
  const Curve copy = curve;  // NOLINT(performance-unnecessary-copy-initialization): the copy is the point
  EXPECT_EQ(&copy.points(), &curve.points());
  EXPECT_EQ(copy.points(), kPoints);
  EXPECT_FALSE(copy.empty());
}

// Catches: a search that leaves the table with a value that is no number.
TEST(Curve, StaysInItsTableForInfinityAndNan) {
  const Curve curve(kPoints);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(curve.value(kInfinity), kInfinity);
  EXPECT_EQ(curve.value(-kInfinity), -kInfinity);
  EXPECT_EQ(curve.held(kInfinity), 5.5);
  EXPECT_TRUE(std::isnan(curve.value(std::nan(""))));
  EXPECT_TRUE(std::isnan(curve.inverse(std::nan(""))));
  EXPECT_TRUE(std::isnan(curve.held(std::nan(""))));
}

// Catches: each rule that is not checked, and a point that is counted from zero.
TEST(Curve, NamesTheFirstBadPoint) {
  EXPECT_EQ(problem_with_points(kPoints, true), "");
  EXPECT_EQ(problem_with_points({}, false), "has 0 points but must have at least 2");
  EXPECT_EQ(problem_with_points({{0.0, 0.0}}, false), "has 1 point but must have at least 2");
  EXPECT_EQ(problem_with_points({{0.0, 0.0}, {1.0, std::nan("")}}, false), "point 2 must be finite");
  EXPECT_EQ(problem_with_points({{0.0, 0.0}, {1.0, 1.0}, {1.0, 2.0}}, false),
            "point 3 must have a larger x than the one before");
  const std::vector<CurvePoint> falling{{0.0, 1.0}, {1.0, 0.5}, {2.0, 0.5}};
  EXPECT_EQ(problem_with_points(falling, false), "");
  EXPECT_EQ(problem_with_points(falling, true), "point 2 must have a larger y than the one before");
  EXPECT_EQ(problem_with_points({{0.0, 0.0}, {1e-320, 1.0}}, false),
            "point 2 must not be so near to the one before, or so far, that the slope between them is lost");
  EXPECT_EQ(problem_with_points({{0.0, 0.0}, {1e300, 1e-300}}, true),
            "point 2 must not be so near to the one before, or so far, that the slope between them is lost");
}

}  // namespace
}  // namespace drivebench::curve_test
