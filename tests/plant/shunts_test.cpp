// Currents that are converted at an instant of the tick, in the wires, below the lower switches or in the
// link.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "plant/parameters/later_rows.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/plant/bridge_rig.hpp"

namespace drivebench::shunts_test {
namespace {

using namespace bridge_rig;
using enum LegLevel;

Sample after_one_tick(const ShuntParameters& shunts, const PhaseCommand& command, double begun_a,
                      const SensorParameters& sensors = {}) {
  AxisParameters p = standing_motor();
  p.sensors.current = sensors.current;
  p.sensors.counts = sensors.counts;
  p.sensors.shunts = shunts;
  EXPECT_TRUE(problems(p).empty());
  Axis axis(p, kTiming, 1, 0);
  set_line_current(axis, begun_a);
  axis.advance(command, 0);
  return axis.sample(1);
}

/// The line current that falls in two lower switches.
double falling(double begun_a, double time_s) {
  return begun_a * std::exp(-time_s / kTime_s);
}

const PhaseCommand kBothLow = legs(list({{0, kLow}}), list({{0, kLow}}));

// Catches: a conversion at the end of the tick or of a substep, a straight line between these, conversions
// that are all at once or in another order.
TEST(Shunts, AConversionTakesTheCurrentOfItsInstant) {
  for (const double sample_s : {1.234e-6, 25e-6, kTick_s - 2.4e-6}) {
    for (const double conversion_s : {0.0, 1.1e-6}) {
      const Sample s = after_one_tick({.sample_s = sample_s, .conversion_s = conversion_s}, kBothLow, 20.0);
      EXPECT_NEAR(s.i_a_a, falling(20.0, sample_s), 1e-10);
      EXPECT_NEAR(s.i_b_a, -falling(20.0, sample_s + conversion_s), 1e-10);
      EXPECT_EQ(s.i_c_a, 0.0);
      EXPECT_NEAR(s.true_i_a_a, falling(20.0, kTick_s), 1e-10);
    }
  }
  EXPECT_NEAR(after_one_tick({.sample_s = kTick_s}, kBothLow, 20.0).i_a_a, falling(20.0, kTick_s), 1e-10);
}

// With two PWM periods in a tick of 50 us the last one begins at 25 us: its peak is at 37.5 us. Catches: an
// angle of the tick or of the first period, a peak at 2 pi, degrees.
TEST(Shunts, AnAngleIsThatOfTheLastPeriodOfTheTick) {
  const auto converted_a = [](const ShuntParameters& shunts, int pwm_periods) {
    AxisParameters p = standing_motor();
    p.drive.inverter.pwm_periods_per_tick = pwm_periods;
    p.sensors.shunts = shunts;
    EXPECT_TRUE(problems(p).empty());
    Axis axis(p, kTiming, 1, 0);
    set_line_current(axis, 20.0);
    axis.advance(kBothLow, 0);
    return axis.sample(1).i_a_a;
  };
  for (const int pwm_periods : {1, 2}) {
    const double begin_s = kTick_s - kTick_s / pwm_periods;
    for (const double part : {0.1, 0.5, 0.75, 1.0}) {
      const double angle_rad = part * 2.0 * std::numbers::pi;
      const double at_s = begin_s + part * kTick_s / pwm_periods;
      EXPECT_NEAR(converted_a({.sample_angle_rad = angle_rad}, pwm_periods), falling(20.0, at_s), 1e-10);
    }
  }
}

// Catches: an angle that rounds to another instant than its nanoseconds do, one that stays where it was when
// the PWM has another period.
TEST(Shunts, AnAngleFollowsThePeriodOfThePwm) {
  for (const double period_s : {0.5 * kTick_s, kTick_s, 2.0 * kTick_s}) {
    AxisParameters p = standing_motor();
    p.sensors.shunts = {.sample_s = 0.75 * period_s};
    Axis by_time(p, {.period_s = period_s, .substeps = 16}, 1, 0);
    p.sensors.shunts = {.sample_angle_rad = 1.5 * std::numbers::pi};
    Axis by_angle(p, {.period_s = period_s, .substeps = 16}, 1, 0);
    for (Axis* const axis : {&by_time, &by_angle}) {
      set_line_current(*axis, 20.0);
      axis->advance(kBothLow, 0);
    }
    EXPECT_EQ(by_angle.sample(1).i_a_a, by_time.sample(1).i_a_a);
    // Steps of 6.25 us err by 2e-9 A, of which the current falls 0.1 ps.
    EXPECT_NEAR(by_angle.sample(1).i_a_a, falling(20.0, 0.75 * period_s), 5e-9);
    p.drive.inverter.pwm_periods_per_tick = 2;
    by_angle.set_parameters(p);
    const double begun_a = currents(by_angle)[0];
    by_angle.advance(kBothLow, 1);
    EXPECT_NEAR(by_angle.sample(2).i_a_a, falling(begun_a, 0.875 * period_s), 5e-9);
  }
}

// Leg a is high from 10 us to 40 us. Catches: a shunt that sees the current of the upper switch, that is
// blind to the lower diode, or that takes the level after an edge at its instant.
TEST(Shunts, ALowSideShuntSeesTheLowerSwitchAndItsDiode) {
  const PhaseCommand pulse = legs(list({{0, kLow}, {10'000, kHigh}, {40'000, kLow}}), list({{0, kLow}}));
  const auto seen_a = [&](double sample_s) {
    return after_one_tick({.place = ShuntPlace::kLowSide, .sample_s = sample_s}, pulse, 20.0);
  };
  EXPECT_NEAR(seen_a(5e-6).i_a_a, falling(20.0, 5e-6), 1e-10);
  EXPECT_NEAR(seen_a(10e-6).i_a_a, falling(20.0, 10e-6), 1e-10) << "the edge comes after";
  EXPECT_EQ(seen_a(10.1e-6).i_a_a, 0.0);
  EXPECT_EQ(seen_a(40e-6).i_a_a, 0.0);
  EXPECT_GT(seen_a(40.1e-6).i_a_a, 20.0);
  EXPECT_LT(seen_a(25e-6).i_b_a, -20.0) << "b stays low";
  // Both legs off: the current comes up through the lower diode of a, and goes into the upper rail from b.
  const Sample off =
      after_one_tick({.place = ShuntPlace::kLowSide, .sample_s = 5e-6}, {.gates = Gates::kOff}, 20.0);
  EXPECT_GT(off.i_a_a, 15.0);
  EXPECT_EQ(off.i_b_a, 0.0);
}

// The textbook's two samples of a period: with one leg high the link carries its current, with two the
// current of the third with the other sign. Catches: a sum over the lower legs, a sign that is that of a leg,
// samples that are one.
TEST(Shunts, TheLinkShowsTwoCurrentsInAPeriod) {
  const PhaseCommand pattern = legs(list({{0, kLow}, {10'000, kHigh}, {40'000, kLow}}),
                                    list({{0, kLow}, {20'000, kHigh}, {30'000, kLow}}), list({{0, kLow}}));
  const ShuntParameters shunts{.place = ShuntPlace::kLink, .sample_s = 15e-6, .conversion_s = 10e-6};
  AxisParameters p = standing_motor();
  p.sensors.shunts = shunts;
  Axis axis(p, kTiming, 1, 0);
  set_line_current(axis, 20.0);
  axis.advance(pattern, 0);
  const Sample link = axis.sample(1);
  const auto in_wires = [&](double sample_s) {
    AxisParameters wires = standing_motor();
    wires.sensors.shunts = {.sample_s = sample_s};
    Axis other(wires, kTiming, 1, 0);
    set_line_current(other, 20.0);
    other.advance(pattern, 0);
    return other.sample(1);
  };
  EXPECT_NEAR(link.i_a_a, in_wires(15e-6).i_a_a, 1e-10);
  EXPECT_NEAR(link.i_b_a, -in_wires(25e-6).i_c_a, 1e-10);
  EXPECT_GT(std::abs(link.i_b_a), 0.5);
  EXPECT_EQ(link.i_c_a, 0.0);
}

// The converter of the wires converts the shunts: gain, offset, bits and number. Catches: numbers of another
// current than the reading, an offset that an idle shunt does not show.
TEST(Shunts, TheirNumbersAreThoseOfTheConverter) {
  SensorParameters sensors;
  sensors.current.bits = 12;
  sensors.current.full_scale_a = 40.0;
  sensors.current.offset_c_a = 1.0;
  sensors.counts = true;
  const Sample s = after_one_tick({.place = ShuntPlace::kLowSide, .sample_s = 5e-6}, kBothLow, 20.0, sensors);
  const double step_a = 40.0 / 2048.0;
  EXPECT_EQ(s.i_a_counts, 2048u + static_cast<std::uint64_t>(std::lround(falling(20.0, 5e-6) / step_a)));
  EXPECT_EQ(s.i_c_counts, 2048u + static_cast<std::uint64_t>(std::lround(1.0 / step_a)));
}

// Catches: an instant beyond the tick, a shunt without a bridge, a filter of the wires that a shunt does not
// have, two conversions of the link that are one.
TEST(Shunts, TheRulesNameTheFieldAndTheReason) {
  const auto only = [](const AxisParameters& p) {
    const std::vector<Problem> found = problems(p);
    EXPECT_EQ(found.size(), 1u);
    return found.empty() ? std::string() : found[0].field + " " + found[0].rule;
  };
  AxisParameters p = standing_motor();
  p.sensors.shunts.place = ShuntPlace::kLink;
  EXPECT_EQ(only(p),
            "current_sensor.place is \"link\" but needs current_sensor.sample_s or sample_angle_rad, and "
            "conversion_s, above 0: two instants");
  p.sensors.shunts = {.conversion_s = 1e-6};
  EXPECT_EQ(only(p),
            "current_sensor.conversion_s is 1e-06 s but must be 0 where current_sensor.sample_s and "
            "sample_angle_rad are 0");
  p.sensors.shunts = {.sample_s = 5e-6};
  p.sensors.current.filter_hz = 1e4;
  EXPECT_EQ(only(p),
            "current_sensor.filter_hz is 10000 Hz but must be 0 with current_sensor.place, sample_s or "
            "sample_angle_rad: the filter "
            "is that of the wires");
  p.sensors.current.filter_hz = 0.0;
  p.sensors.current.delay_ticks = 0.5;
  EXPECT_EQ(only(p),
            "current_sensor.delay_ticks is 0.5 but must be whole with current_sensor.place, sample_s or "
            "sample_angle_rad, which "
            "give the instant");
  p = standing_motor();
  p.sensors.shunts.place = ShuntPlace::kLowSide;
  p.drive.kind = DriveKind::kAveraged;
  EXPECT_EQ(
      only(p),
      "current_sensor.place is \"low_side\" but needs drive.kind = \"switched_inverter\" and a machine with "
      "three phases in a star");
  p.sensors.shunts = {.sample_s = 5e-6, .sample_angle_rad = 3.0};
  EXPECT_EQ(only(p),
            "current_sensor.sample_angle_rad is 3 rad but must be 0 where current_sensor.sample_s gives the "
            "instant");
  p.sensors.shunts = {.sample_angle_rad = 3.0};
  p.drive.kind = DriveKind::kVoltage;
  EXPECT_EQ(only(p),
            "current_sensor.sample_angle_rad is 3 rad but must be 0 unless drive.kind is an inverter, which "
            "has a PWM period");
  std::vector<Problem> found;
  Problems rules(found);
  p.sensors.shunts = {.sample_angle_rad = 3.0, .conversion_s = 14e-6};
  add_period_problems(p, kTick_s, rules);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(
      found[0].field + " " + found[0].rule,
      "current_sensor.sample_angle_rad is 3 rad: the last conversion at 5.18732414637843e-05 s must lie "
      "within the tick, which is 5e-05 s");
  found.clear();
  p.sensors.shunts = {.sample_s = 49e-6, .conversion_s = 1e-6};
  add_period_problems(p, kTick_s, rules);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(
      found[0].field + " " + found[0].rule,
      "current_sensor.sample_s is 4.9e-05 s: the last conversion at 5.1e-05 s must lie within the tick, "
      "which is 5e-05 s");
}

}  // namespace
}  // namespace drivebench::shunts_test
