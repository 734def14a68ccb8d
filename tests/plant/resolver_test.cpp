#include "plant/sensors/resolver.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace drivebench::resolver_test {
namespace {

// Catches: sine and cosine exchanged, the pole pairs left out, an angle that turns the other way.
TEST(Resolver, ADecoderFindsThePolePairsTimesTheAngle) {
  const ResolverParameters p{.pole_pairs = 3, .amplitude_v = 4.0};
  for (double angle_rad = -0.1; angle_rad < 6.4; angle_rad += 0.05) {
    const ResolverVoltages v = resolver_voltages(p, angle_rad);
    EXPECT_NEAR(std::hypot(v.sine_v, v.cosine_v), 4.0, 1e-14);
    const double error_rad =
        std::remainder(std::atan2(v.sine_v, v.cosine_v) - 3.0 * angle_rad, 2.0 * std::numbers::pi);
    EXPECT_NEAR(error_rad, 0.0, 1e-14);
  }
}

// Catches: an amplitude error on both windings, or on the other one.
TEST(Resolver, EachWindingHasItsOwnAmplitude) {
  const ResolverParameters p{.amplitude_v = 2.0, .sine_gain = 1.1, .cosine_gain = 0.9};
  const ResolverVoltages v = resolver_voltages(p, 0.6);
  EXPECT_NEAR(v.sine_v, 2.0 * 1.1 * std::sin(0.6), 1e-15);
  EXPECT_NEAR(v.cosine_v, 2.0 * 0.9 * std::cos(0.6), 1e-15);
}

}  // namespace
}  // namespace drivebench::resolver_test
