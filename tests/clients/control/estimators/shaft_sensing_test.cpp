#include "clients/control/estimators/shaft_sensing.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "clients/control/loop/three_phase.hpp"

namespace drivebench::control::shaft_sensing_test {
namespace {

constexpr SpeedObserverGains kGains = SpeedObserverGains::placed(500.0, 500.0, 0.0);

// Catches: a position that begins at count 0, and a disc that begins at the first sample.
TEST(ShaftSensing, CountsThePositionFromTheFirstSampleAndTheDiscFromZero) {
  ShaftSensing shaft(2000.0, kGains, 0.0, 1e-4);
  shaft.measure(5500, 1, 0.0);
  EXPECT_EQ(shaft.angle_rad(), 0.0);
  EXPECT_NEAR(shaft.disc_rad(), 1.5 * std::numbers::pi, 1e-12);
  shaft.measure(5510, 1, 0.0);
  EXPECT_NEAR(shaft.angle_rad(), 0.01 * std::numbers::pi, 1e-12);
  shaft.measure(-500, 1, 0.0);
  EXPECT_NEAR(shaft.disc_rad(), -0.5 * std::numbers::pi, 1e-12);
}

// Catches: an observer that stands still over lost samples: at constant speed a gap of ten periods changes
// nothing.
TEST(ShaftSensing, CarriesTheSpeedOverAGap) {
  ShaftSensing shaft(2000.0, kGains, 0.0, 1e-4);
  std::int64_t count = 0;
  for (int k = 0; k < 1000; ++k)
    shaft.measure(count += 2, 1, 0.0);
  const double speed = 2.0 * 2.0 * std::numbers::pi / 2000.0 * 1e4;
  EXPECT_NEAR(shaft.speed_rad_s(), speed, 1e-6);
  shaft.measure(count += 20, 10, 0.0);
  shaft.measure(count += 2, 1, 0.0);
  EXPECT_NEAR(shaft.speed_rad_s(), speed, 1e-6);
}

// Catches: an observer without the torque: under a constant acceleration that it is told the speed has no
// lag.
TEST(ShaftSensing, FollowsAKnownAcceleration) {
  ShaftSensing shaft(1e9, kGains, 0.0, 1e-4);  // no steps to speak of
  for (int k = 0; k < 1000; ++k) {
    const double t = 1e-4 * k;
    shaft.measure(static_cast<std::int64_t>(0.5 * 1000.0 * t * t * 1e9 / (2.0 * std::numbers::pi)), 1,
                  1000.0);
  }
  EXPECT_NEAR(shaft.speed_rad_s(), 1000.0 * 0.0999, 0.2);
}

// Catches: a transform that is not power-invariant, or not the inverse of the other.
TEST(ThreePhase, IsPowerInvariantAndInvertible) {
  const TwoPhase x = three_to_two({.a = 208.0 * std::numbers::sqrt2 * std::numbers::inv_sqrt3,
                                   .b = -104.0 * std::numbers::sqrt2 * std::numbers::inv_sqrt3,
                                   .c = -104.0 * std::numbers::sqrt2 * std::numbers::inv_sqrt3});
  EXPECT_NEAR(x.a, 208.0, 1e-9);
  EXPECT_NEAR(x.b, 0.0, 1e-9);
  const Setpoint back = terminal_values({.a = 3.0, .b = -4.0}, true);
  const TwoPhase again = three_to_two({.a = back.a, .b = back.b, .c = back.c});
  EXPECT_NEAR(again.a, 3.0, 1e-12);
  EXPECT_NEAR(again.b, -4.0, 1e-12);
  EXPECT_NEAR(back.a * back.a + back.b * back.b + back.c * back.c, 25.0, 1e-12);
}

}  // namespace
}  // namespace drivebench::control::shaft_sensing_test
