#include "plant/math/rotated.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace drivebench::rotated_test {
namespace {

// Catches: a wrong coefficient, a turn in the wrong direction. The tolerance is the first term left out.
TEST(Rotated, IsTheCosineAndSineOfTheSum) {
  for (double start = -3.0; start < 3.0; start += 0.37) {
    for (double by = -0.8; by <= 0.8; by += 0.05) {
      const CosSin e = rotated(cos_sin(start), by);
      const double tolerance = std::pow(by, 8.0) / 40320.0 + 4e-16;
      EXPECT_NEAR(e.cos, std::cos(start + by), tolerance);
      EXPECT_NEAR(e.sin, std::sin(start + by), tolerance);
    }
  }
}

// Catches: a series that does not begin with 1, which would move a rotor that stands.
TEST(Rotated, ByNothingIsTheStart) {
  const CosSin start = cos_sin(0.7);
  const CosSin same = rotated(start, 0.0);
  EXPECT_EQ(same.cos, start.cos);
  EXPECT_EQ(same.sin, start.sin);
}

}  // namespace
}  // namespace drivebench::rotated_test
