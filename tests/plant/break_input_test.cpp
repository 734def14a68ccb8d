// The break input: a current or the fault line of the gate driver opens all legs within the tick.
#include <gtest/gtest.h>

#include <cmath>

#include "plant/parameters/parameters.hpp"
#include "tests/plant/bridge_rig.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::break_input_test {
namespace {

using namespace bridge_rig;
using enum LegLevel;

constexpr double kLimit_a = 60.0;
const PhaseCommand kForward = legs(list({{0, kHigh}}), list({{0, kLow}}));
const PhaseCommand kBackward = legs(list({{0, kLow}}), list({{0, kHigh}}));

AxisParameters guarded(double delay_s) {
  AxisParameters p = standing_motor();
  p.drive.inverter.break_current_a = kLimit_a;
  p.drive.inverter.break_delay_s = delay_s;
  return p;
}

/// The line current from zero on the whole link.
double current_at(double time_s) {
  return 0.5 * kLink_v / kResistance_ohm * (1.0 - std::exp(-time_s / kTime_s));
}

const double kCrossing_s = -kTime_s * std::log(1.0 - kLimit_a * kResistance_ohm / (0.5 * kLink_v));

// The current passes 60 A at tau ln 2 = 277 us, and the legs open after the delay, in another tick if it is
// long: at once the current falls in the diodes. Catches: legs that open at the end of a substep or tick, a
// delay that is left out, counted twice or lost between two ticks, a comparator of one sign or of one phase.
TEST(BreakInput, ACurrentOpensTheLegsAtItsInstant) {
  for (const double delay_s :
       {0.0, 120e-9, 10e-6, kTick_s - std::fmod(kCrossing_s, kTick_s), 3.2 * kTick_s}) {
    for (const double sign : {1.0, -1.0}) {
      const PhaseCommand& command = sign > 0.0 ? kForward : kBackward;
      Axis axis(guarded(delay_s), kTiming, 1, 0);
      const double opens_s = kCrossing_s + delay_s;
      const auto last_tick = static_cast<Tick>(opens_s / kTick_s + 1e-12);
      for (Tick tick = 0; tick < last_tick; ++tick) {
        axis.advance(command, tick);
        ASSERT_EQ(axis.sample(tick + 1).faults, 0u) << tick;
      }
      axis.advance(command, last_tick);
      const Sample s = axis.sample(last_tick + 1);
      EXPECT_EQ(s.faults, kBreakInput);
      const double end_s = static_cast<double>(last_tick + 1) * kTick_s;
      const double against_a = 0.5 * kLink_v / kResistance_ohm;
      const double left_a =
          (current_at(opens_s) + against_a) * std::exp(-(end_s - opens_s) / kTime_s) - against_a;
      // 100 steps err by 4e-9 A; at the 0.3 A/us of the turn 1e-8 A are 30 fs.
      EXPECT_NEAR(sign * s.true_i_a_a, left_a, 1e-8) << delay_s;
    }
  }
}

// Catches: a latch that opens again by itself or with the current gone, gates that a cleared latch leaves
// off, a break input that does not work a second time.
TEST(BreakInput, TheLegsStayOpenUntilTheLatchIsCleared) {
  Axis axis(guarded(0.0), kTiming, 1, 0);
  Tick tick = 0;
  for (; tick < 30; ++tick)
    axis.advance(kForward, tick);
  EXPECT_EQ(axis.sample(tick).faults, kBreakInput);
  EXPECT_EQ(currents(axis)[0], 0.0);
  axis.clear_faults();
  axis.advance(kForward, tick++);
  EXPECT_EQ(axis.sample(tick).faults, 0u);
  EXPECT_NEAR(currents(axis)[0], current_at(kTick_s), 1e-9);
  for (; tick < 60; ++tick)
    axis.advance(kForward, tick);
  EXPECT_EQ(axis.sample(tick).faults, kBreakInput);
  EXPECT_EQ(currents(axis)[0], 0.0);
}

// Catches: a fault line that only works with a comparator or waits for the next tick, legs that close while
// the line is still pulled, a delay that it leaves out.
TEST(BreakInput, TheFaultLineOpensTheLegs) {
  const std::size_t row = find_injectable_fault("gate_driver_fault");
  for (const double delay_s : {0.0, 500e-9}) {
    AxisParameters p = standing_motor();
    p.drive.inverter.break_delay_s = delay_s;
    Axis axis(p, kTiming, 1, 0);
    axis.advance(kForward, 0);
    axis.inject(row, 1.0);
    axis.advance(kForward, 1);
    EXPECT_EQ(axis.sample(2).faults, kBreakInput);
    const double against_a = 0.5 * kLink_v / kResistance_ohm;
    const double opens_s = kTick_s + delay_s;
    EXPECT_NEAR(
        currents(axis)[0],
        std::max(0.0, (current_at(opens_s) + against_a) * std::exp(-(2.0 * kTick_s - opens_s) / kTime_s) -
                          against_a),
        1e-9);
    axis.clear_faults();
    axis.advance(kForward, 2);
    EXPECT_EQ(axis.sample(3).faults, kBreakInput) << "the line is still pulled";
    axis.inject(row, 0.0);
    axis.clear_faults();
    axis.advance(kForward, 3);
    EXPECT_EQ(axis.sample(4).faults, 0u);
    EXPECT_GT(currents(axis)[0], 10.0);
  }
}

// Catches: a limit that has been lowered below the current and waits for it to pass.
TEST(BreakInput, ACurrentThatIsBeyondTheLimitOpensAtOnce) {
  AxisParameters p = standing_motor();
  Axis axis(p, kTiming, 1, 0);
  set_line_current(axis, 10.0);
  p.drive.inverter.break_current_a = 9.0;
  axis.set_parameters(p);
  axis.advance(kForward, 0);
  EXPECT_EQ(axis.sample(1).faults, kBreakInput);
  EXPECT_EQ(currents(axis)[0], 0.0);
}

// Two equal motors on one shaft, each on its bridge: one trips as it does alone, and the other goes on.
// Catches: a shared shaft that leaves the break input out, or that opens both.
TEST(BreakInput, OneOfTwoMotorsOnAShaftOpensAlone) {
  Axis alone(guarded(120e-9), kTiming, 1, 0);
  Axis first(guarded(120e-9), kTiming, 1, 0);
  Axis second(standing_motor(), kTiming, 1, 1);
  for (Tick tick = 0; tick < 8; ++tick) {
    alone.advance(kForward, tick);
    Axis::advance_pair(first, second, kForward, kForward, tick);
    ASSERT_NEAR(currents(first)[0], currents(alone)[0], 1e-9) << tick;
    ASSERT_NEAR(currents(second)[0], current_at(static_cast<double>(tick + 1) * kTick_s), 1e-8) << tick;
  }
  EXPECT_EQ(first.sample(8).faults, kBreakInput);
  EXPECT_EQ(second.sample(8).faults, 0u);
}

// Catches: a fault line that two machines on one amplifier do not have together, or that opens it at the
// end of the tick.
TEST(BreakInput, TheFaultLineOpensASharedAmplifier) {
  const std::size_t row = find_injectable_fault("gate_driver_fault");
  constexpr double kDelay_s = 500e-9;
  AxisParameters p = standing_motor();
  p.drive.inverter.break_delay_s = kDelay_s;
  Axis first(p, kTiming, 1, 0);
  Axis second(p, kTiming, 1, 1);
  Axis::advance_on_one_amplifier(first, second, kForward, 0);
  first.inject(row, 1.0);
  second.inject(row, 1.0);
  Axis::advance_on_one_amplifier(first, second, kForward, 1);
  EXPECT_EQ(first.sample(2).faults, kBreakInput);
  EXPECT_EQ(second.sample(2).faults, kBreakInput);
  const double against_a = 0.5 * kLink_v / kResistance_ohm;
  const double zero_s = kTime_s * std::log(1.0 + current_at(kTick_s + kDelay_s) / against_a);
  ASSERT_LT(zero_s, kTick_s - kDelay_s);
  EXPECT_NEAR(currents(first)[0], 0.0, 1e-9);
  EXPECT_NEAR(currents(second)[0], 0.0, 1e-9);
  ASSERT_FALSE(events(first).empty());
  EXPECT_NEAR(events(first).front(), kDelay_s, 1e-15);
}

// Catches: a comparator on a drive without gates, or of one of two machines on an amplifier.
TEST(BreakInput, TheRulesNameTheKindOfDrive) {
  AxisParameters p = guarded(0.0);
  EXPECT_TRUE(problems(p).empty());
  p.drive.kind = DriveKind::kVoltage;
  const std::vector<Problem> found = problems(p);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].field, "inverter.break_current_a");
  EXPECT_EQ(found[0].rule, "is 60 but must be 0 unless drive.kind is an inverter");
}

}  // namespace
}  // namespace drivebench::break_input_test
