#include "plant/sensors/tachometer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace drivebench::tachometer_test {
namespace {

constexpr TachometerParameters kTachometer{.gain_vs_per_rad = 0.03, .ripple = 0.05, .ripple_per_turn = 22};

// DC-04: the voltage of an open generator. Catches: a voltage that forgets the direction.
TEST(Tachometer, TheVoltageFollowsTheSpeedWithItsSign) {
  constexpr TachometerParameters p{.gain_vs_per_rad = 0.03};
  EXPECT_EQ(tachometer_v(p, 1.0, 200.0), 0.03 * 200.0);
  EXPECT_EQ(tachometer_v(p, 1.0, -200.0), -0.03 * 200.0);
  EXPECT_EQ(tachometer_v(p, 1.0, 0.0), 0.0);
}

// Catches: a ripple in volts in place of a part of the voltage, one per turn, one that shifts the mean.
TEST(Tachometer, TheRippleHasItsAmplitudeItsPeriodAndNoMean) {
  constexpr double kTurn_rad = 2.0 * std::numbers::pi;
  for (const double speed_rad_s : {100.0, -30.0}) {
    const double mean_v = 0.03 * speed_rad_s;
    double sum_v = 0.0;
    double high = -1e9;
    double low = 1e9;
    constexpr int kPoints = 22 * 40;
    for (int n = 0; n < kPoints; ++n) {
      const double angle_rad = kTurn_rad * n / kPoints;
      const double v = tachometer_v(kTachometer, angle_rad, speed_rad_s);
      EXPECT_NEAR(v, tachometer_v(kTachometer, angle_rad + kTurn_rad / 22, speed_rad_s), 1e-12);
      sum_v += v;
      high = std::max(high, v / mean_v);
      low = std::min(low, v / mean_v);
    }
    EXPECT_NEAR(sum_v / kPoints, mean_v, 1e-12);
    EXPECT_NEAR(high, 1.05, 1e-12);
    EXPECT_NEAR(low, 0.95, 1e-12);
  }
}

}  // namespace
}  // namespace drivebench::tachometer_test
