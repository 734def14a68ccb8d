// The supplies of the upper gate drivers: an upper switch that opens when its supply is empty.
#include "plant/drive/bootstrap.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "plant/gate_axis.hpp"
#include "plant/parameters/drive_rows.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/plant/bridge_rig.hpp"

namespace drivebench::bootstrap_test {
namespace {

using namespace bridge_rig;
using enum LegLevel;

const PhaseCommand kForward = legs(list({{0, kHigh}}), list({{0, kLow}}));
const PhaseCommand kBothLow = legs(list({{0, kLow}}), list({{0, kLow}}));

AxisParameters fed(double bootstrap_s, double recharge_s = 0.0) {
  AxisParameters p = standing_motor();
  p.drive.inverter.bootstrap_s = bootstrap_s;
  p.drive.inverter.bootstrap_recharge_s = recharge_s;
  return p;
}

/// The line current from zero on the whole link.
double current_at(double time_s) {
  return 0.5 * kLink_v / kResistance_ohm * (1.0 - std::exp(-time_s / kTime_s));
}

// The upper switch of a is closed from the start, and opens when its supply is empty: the current goes on in
// the lower diode of a and the lower switch of b, and falls with R/L alone. Catches: a switch that opens at
// the end of a tick or substep, a supply that begins anew with each tick, a leg that stays at the rail, a
// fault that comes late or stays away.
TEST(Bootstrap, AnUpperSwitchOpensAtTheInstantAtWhichItsSupplyIsEmpty) {
  for (const double limit_s : {1e-7, 12.34e-6, kTick_s, 2.0 * kTick_s + 17.7e-6, 5.0 * kTick_s}) {
    Axis axis(fed(limit_s), kTiming, 1, 0);
    for (Tick tick = 0; tick < 8; ++tick) {
      axis.advance(kForward, tick);
      const double end_s = static_cast<double>(tick + 1) * kTick_s;
      const double wanted_a = end_s < limit_s + 1e-12
                                  ? current_at(end_s)
                                  : current_at(limit_s) * std::exp(-(end_s - limit_s) / kTime_s);
      // 100 steps err by 4e-9 A; at the 0.3 A/us of the turn 1e-8 A are 30 fs.
      ASSERT_NEAR(currents(axis)[0], wanted_a, 1e-8) << limit_s << " " << tick;
      ASSERT_EQ(axis.sample(tick + 1).faults, end_s > limit_s + 1e-12 ? kBootstrapEmpty : 0u) << tick;
    }
  }
}

// Each tick the leg is high for 45 us and low for 5 us. Filled within 20 us a supply of 200 us takes 50 us
// back in these 5: full each time. Within 40 us it takes back 25 us, loses 20 us in each tick, and has 40 us
// left in the ninth. Catches: a supply that is full with the first low, that takes back nothing or for ever,
// that an open leg or a dead time uses up.
TEST(Bootstrap, AShortLowGivesAPartBack) {
  const PhaseCommand pulse = legs(list({{0, kHigh}, {45'000, kLow}}), list({{0, kLow}}));
  Axis full(fed(200e-6, 20e-6), kTiming, 1, 0);
  Axis losing(fed(200e-6, 40e-6), kTiming, 1, 0);
  for (Tick tick = 0; tick < 8; ++tick) {
    full.advance(pulse, tick);
    losing.advance(pulse, tick);
    ASSERT_EQ(losing.sample(tick + 1).faults | full.sample(tick + 1).faults, 0u) << tick;
    // 1e-15 s: the rounding of these times in 200 us.
    ASSERT_NEAR(losing.state().bootstrap.used_s[0] +
                    (losing.state().bootstrap.level[0] < 0 ? -(kTick_s - 45e-6) * 5.0 : 0.0),
                static_cast<double>(tick + 1) * 20e-6, 1e-15);
  }
  losing.advance(pulse, 8);
  full.advance(pulse, 8);
  EXPECT_EQ(full.sample(9).faults, 0u);
  EXPECT_EQ(losing.sample(9).faults, kBootstrapEmpty);
  EXPECT_NEAR(events(losing).front(), 40e-6, 1e-14);
}

// An empty supply, then a low of 10 us less or more a nanosecond, and high again. Catches: a switch that
// closes with half a supply, one that stays open for ever, a supply that an open leg fills, a fault that is
// latched.
TEST(Bootstrap, AnEmptySupplyHasToBeFullAgain) {
  for (const std::uint32_t low_ns : {9'999u, 10'000u, 10'001u}) {
    Axis axis(fed(30e-6, 10e-6), kTiming, 1, 0);
    axis.advance(kForward, 0);
    axis.advance(kForward, 1);
    EXPECT_EQ(axis.sample(2).faults, kBootstrapEmpty);
    const double begun_a = currents(axis)[0];
    axis.advance(legs(list({{0, kHigh}, {5'000, kLow}, {5'000 + low_ns, kHigh}}), list({{0, kLow}})), 2);
    EXPECT_EQ(axis.sample(3).faults, kBootstrapEmpty) << "for the first 15 us";
    const double closed_s = 5e-6 + 1e-9 * static_cast<double>(low_ns);
    const double then_a = begun_a * std::exp(-closed_s / kTime_s);
    const double high_s = std::min(kTick_s - closed_s, 30e-6);
    const double end_a = 0.5 * kLink_v / kResistance_ohm;
    const double again_a = (end_a - (end_a - then_a) * std::exp(-high_s / kTime_s)) *
                           std::exp(-(kTick_s - closed_s - high_s) / kTime_s);
    EXPECT_NEAR(currents(axis)[0], low_ns < 10'000 ? begun_a * std::exp(-kTick_s / kTime_s) : again_a, 1e-8);
    axis.advance(kBothLow, 3);
    axis.advance(kBothLow, 4);
    EXPECT_EQ(axis.sample(5).faults, 0u);
    EXPECT_EQ(axis.state().bootstrap.empty, 0u);
  }
}

// Catches: supplies that follow the pieces of a tick and so depend on substeps or conversions.
TEST(Bootstrap, TheSuppliesDoNotDependOnTheDivisionOfATick) {
  const PhaseCommand pulse =
      legs(list({{1'234, kHigh}, {46'789, kLow}}), list({{777, kLow}, {30'001, kHigh}}));
  AxisParameters p = fed(210.7e-6, 43e-6);
  Axis axis(p, kTiming, 1, 0);
  p.sensors.shunts = {.sample_s = 11.3e-6, .conversion_s = 1.7e-6};
  Axis other(p, {.period_s = kTick_s, .substeps = 7}, 1, 0);
  std::uint64_t faults = 0;
  for (Tick tick = 0; tick < 60; ++tick) {
    axis.advance(pulse, tick);
    other.advance(pulse, tick);
    faults |= axis.sample(tick + 1).faults;
    ASSERT_EQ(std::memcmp(&axis.state().bootstrap, &other.state().bootstrap, sizeof(BootstrapMemory)), 0)
        << tick;
  }
  EXPECT_EQ(faults, kBootstrapEmpty);
}

// Catches: a supply or an open switch that a saved state forgets.
TEST(Bootstrap, ARestoredStateGoesOnWithTheSameBits) {
  const PhaseCommand pulse = legs(list({{0, kHigh}, {48'000, kLow}}), list({{0, kLow}}));
  const AxisParameters p = fed(150e-6, 90e-6);
  Axis axis(p, kTiming, 1, 0);
  for (Tick tick = 0; tick < 40; ++tick) {
    Axis other(p, kTiming, 1, 0);
    other.restore(axis.state());
    axis.advance(pulse, tick);
    other.advance(pulse, tick);
    ASSERT_EQ(std::memcmp(&axis.state(), &other.state(), sizeof(AxisState)), 0) << tick;
  }
}

// Catches: a lower switch or an open leg that needs a supply, a stuck switch that it opens, gates off whose
// supplies run down.
TEST(Bootstrap, OnlyAClosedUpperSwitchNeedsASupply) {
  const PhaseCommand off{};
  for (const PhaseCommand& command : {kBothLow, off, legs(list({{0, kOff}}), list({{0, kLow}}))}) {
    Axis axis(fed(30e-6), kTiming, 1, 0);
    for (Tick tick = 0; tick < 3; ++tick)
      axis.advance(command, tick);
    EXPECT_EQ(axis.sample(3).faults, 0u);
    EXPECT_EQ(axis.state().bootstrap.used_s[0], 0.0);
  }
  Axis stuck(fed(30e-6), kTiming, 1, 0);
  stuck.inject(find_injectable_fault("leg_stuck_high"), 1.0);
  for (Tick tick = 0; tick < 3; ++tick)
    stuck.advance(kForward, tick);
  EXPECT_NEAR(currents(stuck)[0], current_at(3.0 * kTick_s), 1e-8) << "a switch that is shorted";
}

// Catches: a shared shaft that leaves the supplies out, or that opens both.
TEST(Bootstrap, OneOfTwoMotorsOnAShaftOpensAlone) {
  Axis alone(fed(77e-6), kTiming, 1, 0);
  Axis first(fed(77e-6), kTiming, 1, 0);
  Axis second(standing_motor(), kTiming, 1, 1);
  for (Tick tick = 0; tick < 4; ++tick) {
    alone.advance(kForward, tick);
    Axis::advance_pair(first, second, kForward, kForward, tick);
    ASSERT_NEAR(currents(first)[0], currents(alone)[0], 1e-9) << tick;
    ASSERT_NEAR(currents(second)[0], current_at(static_cast<double>(tick + 1) * kTick_s), 1e-8) << tick;
  }
  EXPECT_EQ(first.sample(4).faults, kBootstrapEmpty);
  EXPECT_EQ(second.sample(4).faults, 0u);
}

// At gate level, run at once and in a thousand parts with a leg that is set anew on the way. Catches: parts
// that begin with a full supply, a taken-back part whose supply stays used up.
TEST(Bootstrap, AtGateLevelNothingDependsOnHowTheRunIsDivided) {
  const auto current_after = [](int parts) {
    GateAxis axis(fed(170e-6, 20e-6), 50'000, 16, 1, 0);
    axis.set_leg(0, {.mode = LegMode::kHigh});
    axis.set_leg(1, {.mode = LegMode::kLow});
    for (int n = 1; n <= parts; ++n)
      axis.run(static_cast<Picoseconds>(n) * 400'000'000 / parts, {});
    return axis.look().truth.current_a.a;
  };
  EXPECT_EQ(current_after(1), current_after(1000));
  EXPECT_NEAR(current_after(1), current_at(170e-6) * std::exp(-230e-6 / kTime_s), 1e-8);
}

// Catches: supplies on a drive without upper switches or on one that two machines share, a time to fill what
// is never used.
TEST(Bootstrap, TheRulesNameTheFieldAndTheReason) {
  AxisParameters p = fed(1e-3, 1e-5);
  EXPECT_TRUE(problems(p).empty());
  p.drive.kind = DriveKind::kAveraged;
  std::vector<Problem> found = problems(p);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].field + " " + found[0].rule,
            "inverter.bootstrap_s is 0.001 s but needs drive.kind = \"switched_inverter\" and a machine with "
            "three phases in a star");
  found = problems(fed(0.0, 1e-5));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].field + " " + found[0].rule,
            "inverter.bootstrap_recharge_s is 1e-05 s but must be 0 where inverter.bootstrap_s is 0");
  found.clear();
  Problems rules(found);
  add_shared_problems(fed(1e-3).drive, rules);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].field + " " + found[0].rule,
            "inverter.bootstrap_s is 0.001 but must be 0 where two machines share the amplifier");
}

}  // namespace
}  // namespace drivebench::bootstrap_test
