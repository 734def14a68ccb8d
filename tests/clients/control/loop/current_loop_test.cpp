#include "clients/control/loop/current_loop.hpp"

#include <gtest/gtest.h>

#include "plant/math/unbounded.hpp"

namespace drivebench::control::current_loop_test {
namespace {

constexpr CurrentGains kBookGains = {.proportional_v_per_a = 6.4, .integral_v_per_as = 740.0};
constexpr double kPeriodS = 125e-6;
const CosSin kAlongPhaseA = cos_sin_unbounded(0.0);

// Catches: exchanged axes and an integral without its period: a constant error gives a staircase of K_I·T·e.
TEST(CurrentLoop, IsProportionalPlusIntegralOnEachAxis) {
  CurrentLoop loop(kBookGains, 80.0, kPeriodS);
  for (int k = 0; k < 100; ++k) {
    const PhaseVoltages command = loop.step({.d = 1.0, .q = -2.0}, kAlongPhaseA);
    EXPECT_NEAR(command.voltage_v.a, 6.4 + 740.0 * kPeriodS * k, 1e-12);
    EXPECT_NEAR(command.voltage_v.b, -2.0 * (6.4 + 740.0 * kPeriodS * k), 1e-12);
    EXPECT_FALSE(command.saturated);
  }
}

// Catches: wind-up: after any time at the limit, the first sample with the opposite error must answer as if
// nothing had been.
TEST(CurrentLoop, IntegratorsStandStillWhileAPhaseIsAtItsLimit) {
  CurrentLoop loop(kBookGains, 80.0, kPeriodS);
  for (int k = 0; k < 1000; ++k) {
    const PhaseVoltages command = loop.step({.d = 1.0, .q = 20.0}, kAlongPhaseA);
    EXPECT_TRUE(command.saturated);
    EXPECT_EQ(command.voltage_v.a, 6.4);
    EXPECT_EQ(command.voltage_v.b, 80.0);
  }
  EXPECT_EQ(loop.step({.d = 0.0, .q = -1.0}, kAlongPhaseA).voltage_v.b, -6.4);
}

// Catches: a limit in dq: an amplifier limits its phases, so at 45 degrees a vector of 1.4 times the limit is
// still possible.
TEST(CurrentLoop, LimitHoldsPerPhaseAndNotPerAxis) {
  CurrentLoop loop(kBookGains, 80.0, kPeriodS);
  const CosSin diagonal = cos_sin_unbounded(0.785398163397448);
  const PhaseVoltages inside = loop.step({.d = 110.0 / 6.4, .q = 0.0}, diagonal);
  EXPECT_FALSE(inside.saturated);
  EXPECT_NEAR(inside.voltage_v.a, 77.78, 0.01);
  EXPECT_NEAR(inside.voltage_v.b, 77.78, 0.01);
  const PhaseVoltages outside = loop.step({.d = -120.0 / 6.4, .q = 0.0}, diagonal);
  EXPECT_TRUE(outside.saturated);
  EXPECT_EQ(outside.voltage_v.a, -80.0);
  EXPECT_EQ(outside.voltage_v.b, -80.0);
}

}  // namespace
}  // namespace drivebench::control::current_loop_test
