#include "plant/drive/current_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/plant/drive_rig.hpp"

namespace drivebench::current_loop_test {
namespace {

/// Tag CUR-01 of the reference: L = 2 mH, R = 2 ohm, K_P = 20 V/A, alpha = R/L = 1000 1/s.
constexpr double kProportional = 20.0;
constexpr double kIntegral = 20.0 * 1000.0;
constexpr RigLoad kLoad{.resistance_ohm = 2.0, .inductance_h = 2e-3};

DriveParameters current_drive(double integral_v_per_as) {
  DriveParameters p = plain_drive(DriveKind::kCurrent);
  p.current_loop = {
      .proportional_v_per_a = kProportional, .integral_v_per_as = integral_v_per_as, .limit_a = 5.0};
  return p;
}

// Catches: a clamp on one side, a field that is not clamped, a common part left in a star.
TEST(CurrentLoop, TheCommandIsClampedAndHasNoCommonPartInAStar) {
  const CurrentLoopParameters p{.proportional_v_per_a = 1.0, .limit_a = 5.0};
  const PhaseValues apart =
      limited_currents(p, {.a = 9.0, .b = -7.0, .c = 2.0, .field = 6.0}, Connection::kIndependent);
  EXPECT_EQ(apart.a, 5.0);
  EXPECT_EQ(apart.b, -5.0);
  EXPECT_EQ(apart.c, 2.0);
  EXPECT_EQ(apart.field, 5.0);
  const PhaseValues star = limited_currents(p, {.a = 3.0, .b = 1.0, .c = -1.0}, Connection::kStar);
  EXPECT_EQ(star.a, 2.0);
  EXPECT_EQ(star.b, 0.0);
  EXPECT_EQ(star.c, -2.0);
}

// Closed form: i = K_P i_r/(K_P + R) (1 - exp(-(K_P + R) t/L)). Sampled every 1 us the loop is half a sample
// late: (K_P + R) h/(2 L) = 0.55 % of the pole, at most 0.2 % of the current.
// Catches: a loop that runs once a tick, the sign of the error, a gain that misses.
TEST(CurrentLoop, ProportionalHasTheFirstOrderResponse) {
  DriveRig rig(current_drive(0.0), Connection::kArmature, kLoad, 100);
  const double rate_per_s = (kProportional + kLoad.resistance_ohm) / kLoad.inductance_h;
  for (int tick = 1; tick <= 10; ++tick) {
    rig.tick(amperes(1.0));
    const double t = tick * kRigTick_s;
    EXPECT_NEAR(rig.current_a[0], kProportional / 22.0 * (1.0 - std::exp(-rate_per_s * t)), 2.5e-3) << tick;
  }
}

// With alpha = R/L the pole of the winding cancels: i = i_r (1 - exp(-K_P t/L)), 0.22 ms to 90 %.
// Catches: an integral with a wrong gain, one that sees the current of one end only.
TEST(CurrentLoop, ProportionalAndIntegralReachTheCommand) {
  DriveRig rig(current_drive(kIntegral), Connection::kArmature, kLoad, 100);
  const double rate_per_s = kProportional / kLoad.inductance_h;
  for (int tick = 1; tick <= 20; ++tick) {
    rig.tick(amperes(-1.0));
    const double t = tick * kRigTick_s;
    EXPECT_NEAR(rig.current_a[0], -(1.0 - std::exp(-rate_per_s * t)), 2.5e-3) << tick;
  }
}

// Catches: an error taken from one end of the interval.
TEST(CurrentLoop, TheIntegralTakesTheMeanError) {
  DriveRig rig(current_drive(kIntegral), Connection::kArmature, kLoad);
  rig.drive.begin_tick(rig.memory, amperes(2.0), {}, 0);
  const TerminalDrive out = rig.drive.at(rig.memory, 0.0, 10e-6, {});
  rig.drive.finish(rig.memory, 0.0, 10e-6, out, {.a = 40.0}, {.a = 0.0}, {.a = 1.0});
  EXPECT_NEAR(rig.memory.integral_v.a, kIntegral * 1.5 * 10e-6, 1e-15);
}

// 5 A need 210 V of proportional part against the emf of 110 V: clipped at 100 V, the current goes backwards.
// After the emf is gone the loop must come to 5 A without the integral of that time.
// Catches: an integral that winds up, a freeze that never lets go, a flag that is not raised.
TEST(CurrentLoop, TheIntegralStandsStillWhileTheVoltageIsClipped) {
  DriveRig rig(current_drive(kIntegral), Connection::kArmature, kLoad, 100);
  rig.load.emf_v = {110.0, 0.0, 0.0};
  for (int tick = 0; tick < 50; ++tick)
    rig.tick(amperes(5.0));
  EXPECT_EQ(rig.memory.saturated, 1.0);
  EXPECT_LT(std::abs(rig.memory.integral_v.a), 100.0);
  rig.load.emf_v = {};
  double highest_a = 0.0;
  for (int tick = 0; tick < 50; ++tick) {
    rig.tick(amperes(5.0));
    highest_a = std::max(highest_a, rig.current_a[0]);
  }
  EXPECT_LT(highest_a, 5.05);
  EXPECT_NEAR(rig.current_a[0], 5.0, 1e-3);
  EXPECT_EQ(rig.memory.saturated, 0.0);
  EXPECT_NEAR(rig.memory.integral_v.a, 5.0 * kLoad.resistance_ohm, 0.1);
}

// An emf against which phase a is clipped freezes its integral alone.
// Catches: integrals that run off with a common part which no current can answer.
TEST(CurrentLoop, InAStarTheIntegralsHaveNoCommonPart) {
  DriveRig rig(current_drive(kIntegral), Connection::kStar, kLoad, 100);
  for (int tick = 0; tick < 100; ++tick)
    rig.tick(amperes(3.0, 0.0, 0.0));
  EXPECT_NEAR(rig.current_a[0], 2.0, 1e-6);
  EXPECT_NEAR(rig.current_a[1], -1.0, 1e-6);
  const PhaseValues& integral = rig.memory.integral_v;
  EXPECT_NEAR(integral.a + integral.b + integral.c, 0.0, 1e-9);
  rig.load.emf_v = {150.0, -75.0, -75.0};
  for (int tick = 0; tick < 20; ++tick)
    rig.tick(amperes(3.0, 0.0, 0.0));
  EXPECT_EQ(rig.memory.saturated, 1.0);
  EXPECT_GT(std::abs(integral.a), 5.0);
  EXPECT_NEAR(integral.a + integral.b + integral.c, 0.0, 1e-9);
}

// Catches: an integral kept over a time without current control, a voltage mode that loops.
TEST(CurrentLoop, OtherGatesEndTheLoop) {
  DriveRig rig(current_drive(kIntegral), Connection::kArmature, kLoad);
  for (int tick = 0; tick < 50; ++tick)
    rig.tick(amperes(2.0));
  EXPECT_GT(rig.memory.integral_v.a, 3.0);
  rig.tick(volts(30.0));
  EXPECT_EQ(rig.memory.integral_v.a, 0.0);
  const TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-5, {});
  EXPECT_EQ(out.mode[0], TerminalMode::kDriven);
  EXPECT_EQ(out.start_v.a, 30.0);
}

// Gain 0.5 and 3 V of offset: the loop sees both, P and I get rid of them.
// Catches: a power stage that the loop goes around.
TEST(CurrentLoop, TheAmplifierIsWithinTheLoop) {
  DriveParameters p = current_drive(kIntegral);
  p.amplifier.gain = 0.5;
  p.amplifier.offset_a_v = 3.0;
  DriveRig rig(p, Connection::kArmature, kLoad);
  rig.drive.begin_tick(rig.memory, amperes(1.0), {}, 0);
  EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-5, {}).start_v.a, 0.5 * kProportional + 3.0);
  for (int tick = 0; tick < 300; ++tick)
    rig.tick(amperes(1.0));
  EXPECT_NEAR(rig.current_a[0], 1.0, 1e-6);
}

}  // namespace
}  // namespace drivebench::current_loop_test
