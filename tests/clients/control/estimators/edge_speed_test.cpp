#include "clients/control/estimators/edge_speed.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace drivebench::control::edge_speed_test {
namespace {

constexpr double kCount_rad = 2.0 * std::numbers::pi / 2000.0;
constexpr double kPeriod_s = 1e-4;

/// Constant speed from a quarter of a count, and the speed seen at each sample once edges have been seen.
template <class Visitor>
void turn(double speed_rad_s, int samples, Visitor visit) {
  EdgeSpeed estimator(2000.0, kPeriod_s);
  for (int k = 0; k < samples; ++k) {
    const double counts = 0.25 + speed_rad_s * k * kPeriod_s / kCount_rad;
    const double count = std::floor(counts);
    // The way back to the edge at which this count began.
    const double way = speed_rad_s > 0.0 ? counts - count : count + 1.0 - counts;
    const double age_s = way * kCount_rad / std::abs(speed_rad_s);
    const double seen = estimator.step(static_cast<std::int64_t>(count), age_s, 1);
    if (std::abs(counts) > 30.0) visit(seen);
  }
}

// Catches: a count taken for an edge, the age added instead of taken off: at a constant speed, slow or fast,
// either way, the speed is exact where the backward difference would be wrong by up to 31.4 rad/s.
TEST(EdgeSpeed, IsExactAtConstantSpeed) {
  for (const double speed_rad_s : {2.0, 17.5, 122.807, -3.0, -400.0}) {
    int seen = 0;
    turn(speed_rad_s, 20000, [&](double x) {
      EXPECT_NEAR(x, speed_rad_s, 1e-6 * std::abs(speed_rad_s));
      ++seen;
    });
    EXPECT_GT(seen, 1000);
  }
}

// Catches: a shaft that stands and is still said to turn: with no edge for an age the speed is below one
// count over that age.
TEST(EdgeSpeed, FadesWhenNoEdgeComes) {
  EdgeSpeed estimator(2000.0, kPeriod_s);
  estimator.step(0, 0.0, 1);
  estimator.step(1, 0.0, 1);
  EXPECT_NEAR(estimator.step(2, 0.0, 1), kCount_rad / kPeriod_s, 1e-9);
  EXPECT_NEAR(estimator.step(2, 1e-4, 1), kCount_rad / 1e-4, 1e-9);
  EXPECT_NEAR(estimator.step(2, 1e-3, 9), kCount_rad / 1e-3, 1e-9);
  for (int k = 0; k < 10000; ++k)
    estimator.step(2, 0.0, 1);
  EXPECT_LT(estimator.step(2, 1.0, 1), kCount_rad / 0.99);
}

// Catches: an edge crossed to and fro that counts as a way of one count each.
TEST(EdgeSpeed, ShakingOnOneEdgeIsNoSpeed) {
  EdgeSpeed estimator(2000.0, kPeriod_s);
  estimator.step(0, 0.0, 1);
  for (int k = 0; k < 20; ++k)
    EXPECT_EQ(estimator.step(k % 2 == 0 ? 1 : 0, 0.5e-4, 1), 0.0);
  EXPECT_NEAR(estimator.step(-1, 0.5e-4, 1), -kCount_rad / kPeriod_s, 1e-9);
}

}  // namespace
}  // namespace drivebench::control::edge_speed_test
