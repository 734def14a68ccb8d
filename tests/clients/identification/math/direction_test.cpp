#include "clients/identification/math/direction.hpp"

#include <gtest/gtest.h>

#include <complex>

namespace drivebench::identification::direction_test {
namespace {

// Angles on both sides of the quarter of a radian where the library takes over, from turns away as well.
// Catches: a series cut short, a sign in it, a base that does not move with its angle.
TEST(Direction, NearAndFarAnglesAreRight) {
  for (const double base : {0.0, 2.0, -70.3}) {
    const Direction from(base);
    for (const double d : {0.0, 1e-6, -0.01, 0.1, -0.2499, 0.2499, 0.2501, -3.0, 50.0}) {
      EXPECT_LT(std::abs(from.of(base + d) - std::polar(1.0, base + d)), 1e-13) << base << " " << d;
      EXPECT_LT(std::abs(from.moved(base + d).of(base + d + 0.2) - std::polar(1.0, base + d + 0.2)), 1e-13);
    }
  }
}

}  // namespace
}  // namespace drivebench::identification::direction_test
