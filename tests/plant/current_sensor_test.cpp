#include "plant/sensors/current_sensor.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "plant/math/noise.hpp"
#include "tests/plant/analog_reading.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::current_sensor_test {
namespace {

// Catches: an ideal sensor that quantises, limits, or loses gain, offset or noise.
TEST(CurrentSensor, TheIdealSensorIsTheStraightLine) {
  const CurrentSensorParameters ideal{.bits = 0, .full_scale_a = 1.0, .noise_rms_a = 0.5};
  const AnalogReading r = read_current(ideal, 1.1, -0.25, 70.0, 0.2);
  EXPECT_EQ(r.value, 1.1 * 70.0 - 0.25 + 0.5 * 0.2);
  EXPECT_FALSE(r.saturated);
}

// Catches: steps of the wrong size (2^bits - 1, or one side only), rounding down in place of to the nearest.
TEST(CurrentSensor, TheConverterRoundsToTheNearestStep) {
  const CurrentSensorParameters p{.bits = 8, .full_scale_a = 16.0};
  constexpr double kStep_a = 0.125;
  for (int code = -128; code <= 127; ++code) {
    for (const double off : {-0.49, 0.0, 0.49}) {
      const AnalogReading r = read_current(p, 1.0, 0.0, (code + off) * kStep_a, 0.0);
      ASSERT_EQ(r.value, code * kStep_a);
      ASSERT_FALSE(r.saturated);
    }
  }
  EXPECT_EQ(read_current(p, 2.0, 0.3, 1.0, 0.0).value, 2.25);  // 2.3 A is step 18.4
  EXPECT_EQ(read_current(p, -1.0, 0.0, 1.0, 0.0).value, -1.0);
}

// Catches: codes beyond the range, a flag that comes a step early or not at all, an overflowing conversion.
TEST(CurrentSensor, TheConverterStopsAtItsEndsAndSaysSo) {
  const CurrentSensorParameters p{.bits = 12, .full_scale_a = 10.0};
  constexpr double kStep_a = 10.0 / 2048.0;
  for (const double current_a : {10.0 - 0.4 * kStep_a, 10.0, 11.0, 1e300}) {
    const AnalogReading r = read_current(p, 1.0, 0.0, current_a, 0.0);
    EXPECT_EQ(r.value, 10.0 - kStep_a);
    EXPECT_TRUE(r.saturated);
  }
  EXPECT_FALSE(read_current(p, 1.0, 0.0, 10.0 - 0.6 * kStep_a, 0.0).saturated);
  for (const double current_a : {-10.0 - 0.6 * kStep_a, -11.0, -1e300}) {
    const AnalogReading r = read_current(p, 1.0, 0.0, current_a, 0.0);
    EXPECT_EQ(r.value, -10.0);
    EXPECT_TRUE(r.saturated);
  }
  EXPECT_FALSE(read_current(p, 1.0, 0.0, -10.0, 0.0).saturated);
  // Ties go up: the upper one is beyond the last code, the lower one on the first.
  EXPECT_EQ(read_current(p, 1.0, 0.0, 10.0 - 0.5 * kStep_a, 0.0).value, 10.0 - kStep_a);
  EXPECT_TRUE(read_current(p, 1.0, 0.0, 10.0 - 0.5 * kStep_a, 0.0).saturated);
  EXPECT_EQ(read_current(p, 1.0, 0.0, -10.0 - 0.5 * kStep_a, 0.0).value, -10.0);
  EXPECT_FALSE(read_current(p, 1.0, 0.0, -10.0 - 0.5 * kStep_a, 0.0).saturated);
}

// 20000 draws: the rms estimate scatters by 0.5 %, the mean by 0.7 % of the rms, the correlation by 0.7 %.
// Catches: a wrong amplitude, one noise for both phases or all ticks.
TEST(CurrentSensor, TheNoiseOfAnAxisHasItsRmsAndDiffersBetweenPhasesAndTicks) {
  AxisParameters p = servo_axis();
  p.sensors.current.noise_rms_a = 0.03;
  const Axis axis(p, kServoTiming, 9, 0);
  constexpr int kDraws = 20'000;
  double sum_a = 0.0, sum_aa = 0.0, sum_bb = 0.0, sum_ab = 0.0, sum_next = 0.0, previous = 0.0;
  for (Tick tick = 0; tick < kDraws; ++tick) {
    const Sample s = axis.sample(tick);
    sum_a += s.i_a_a;
    sum_aa += s.i_a_a * s.i_a_a;
    sum_bb += s.i_b_a * s.i_b_a;
    sum_ab += s.i_a_a * s.i_b_a;
    sum_next += s.i_a_a * previous;
    previous = s.i_a_a;
  }
  EXPECT_NEAR(std::sqrt(sum_aa / kDraws), 0.03, 0.03 * 0.02);
  EXPECT_NEAR(std::sqrt(sum_bb / kDraws), 0.03, 0.03 * 0.02);
  EXPECT_NEAR(sum_a / kDraws, 0.0, 0.03 * 0.03);
  EXPECT_NEAR(sum_ab / kDraws, 0.0, 0.03 * 0.03 * 0.03);
  EXPECT_NEAR(sum_next / kDraws, 0.0, 0.03 * 0.03 * 0.03);
}

// Catches: noise that depends on the order of calls, axes or seeds that share their noise.
TEST(CurrentSensor, TheNoiseIsAFunctionOfSeedAxisAndTick) {
  AxisParameters p = servo_axis();
  p.sensors.current.noise_rms_a = 1.0;
  const Axis axis(p, kServoTiming, 9, 0);
  const double first = axis.sample(5).i_a_a;
  EXPECT_NE(axis.sample(6).i_a_a, first);
  EXPECT_EQ(axis.sample(5).i_a_a, first);
  EXPECT_EQ(first, gaussian_noise(9, 0, 5));
  EXPECT_NE(Axis(p, kServoTiming, 10, 0).sample(5).i_a_a, first);
  EXPECT_NE(Axis(p, kServoTiming, 9, 1).sample(5).i_a_a, first);
  EXPECT_NE(Axis(p, kServoTiming, 9, 1).sample(5).i_a_a, axis.sample(5).i_b_a);
}

// Catches: gains or offsets of the phases exchanged; a saturated converter that the fault word does not show.
TEST(CurrentSensor, EachPhaseHasItsOwnGainAndOffsetAndSaturationIsAFaultBit) {
  AxisParameters p = servo_axis();
  p.sensors.current = {
      .bits = 10, .full_scale_a = 8.0, .gain_a = 2.0, .gain_b = 1.0, .offset_a_a = 0.5, .offset_b_a = -1.0};
  const auto measured = [&p](double b_a) {
    Axis axis(p, {.period_s = 1e-15, .substeps = 1}, 1, 0);  // too short for the currents to change
    AxisState state = axis.state();
    set_induction_state(state, {.i_a_a = 1.0, .i_b_a = b_a});
    axis.restore(state);
    axis.advance({.gates = Gates::kVoltage}, 0);
    EXPECT_EQ(axis.state().faults, 0u);
    return axis.sample(1);
  };
  EXPECT_EQ(measured(3.0).i_a_a, 2.5);
  EXPECT_EQ(measured(3.0).i_b_a, 2.0);
  EXPECT_EQ(measured(3.0).faults, 0u);
  EXPECT_EQ(measured(20.0).faults, kCurrentSensorSaturated);
}

}  // namespace
}  // namespace drivebench::current_sensor_test
