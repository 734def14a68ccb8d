#include <gtest/gtest.h>

#include <cmath>
#include <string_view>

#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::bench_shared_amplifier_test {
namespace {

constexpr Owner kOwner = 7;

/// Two motors on the amplifier of the first, the second with twice the inertia, and a third on its own.
BenchSetup shared_setup() {
  BenchSetup setup = servo_setup();
  AxisParameters heavy = servo_axis();
  heavy.mechanics.inertia_kgm2 *= 2.0;
  setup.axes.push_back({.parameters = heavy, .shares_amplifier_with = 0});
  setup.axes.push_back({.parameters = servo_axis()});
  return setup;
}

Refused submit_to(Bench& bench, std::uint32_t axis, const Action& action, Owner owner = kOwner) {
  return bench.submit({.tick = bench.tick(), .axis = axis, .owner = owner, .action = action});
}

void drive(Bench& bench, int ticks, double amplitude_v = 40.0) {
  for (int i = 0; i < ticks; ++i) {
    const double angle = 2.0 * 3.14159265358979 * 20.0 * kServoTick_s * static_cast<double>(bench.tick());
    ASSERT_EQ(submit_volts(bench, kOwner, amplitude_v * std::cos(angle), amplitude_v * std::sin(angle)),
              Refused::kNot);
    bench.step();
  }
}

// Catches: a second axis that waits for commands of its own, that shows itself idle and without a controller
// while it is driven, or other voltages.
TEST(BenchSharedAmplifier, OneCommandDrivesBothAxes) {
  Bench bench = owned_bench(shared_setup(), kOwner);
  drive(bench, 400);
  const Sample& first = bench.sample(0);
  const Sample& second = bench.sample(1);
  EXPECT_EQ(second.u_a_v, first.u_a_v);
  EXPECT_EQ(second.u_b_v, first.u_b_v);
  EXPECT_GT(first.speed_rad_s, second.speed_rad_s);
  EXPECT_GT(second.speed_rad_s, 1.0);
  EXPECT_NE(second.true_i_a_a, first.true_i_a_a);
  EXPECT_EQ(second.state, first.state);
  EXPECT_EQ(second.owner, kOwner);
  EXPECT_EQ(second.command_tick, first.command_tick);
  EXPECT_TRUE(bench.owner(1) == kOwner && bench.owner(2) == 0);
  EXPECT_EQ(bench.sample(2).speed_rad_s, 0.0);
}

// Catches: a command or a lease for the second axis, by its owner or by a stranger, before or after the first
// has a controller; a refusal that is counted or that names another reason.
TEST(BenchSharedAmplifier, TheSecondAxisTakesNoCommandsAndNoLease) {
  for (const Owner owner : {kOwner, Owner{8}}) {
    Bench bench(shared_setup());
    for (int tick = 0; tick < 2; ++tick) {
      const std::uint64_t before = bench.state_hash();
      EXPECT_EQ(submit_to(bench, 1, volts_in_answer_to(bench.tick(), 1.0), owner), Refused::kSharedAmplifier);
      for (const LeaseAction action :
           {LeaseAction::kAcquire, LeaseAction::kRenew, LeaseAction::kRelease, LeaseAction::kLost}) {
        EXPECT_EQ(submit_to(bench, 1, action, owner), Refused::kSharedAmplifier);
      }
      EXPECT_EQ(submit_to(bench, 1, ClearFaults{}, owner), Refused::kSharedAmplifier);
      EXPECT_EQ(judge(volts_in_answer_to(0, 1.0), owner, bench.command_view(1)), Refused::kSharedAmplifier);
      EXPECT_EQ(bench.state_hash(), before);
      submit_lease(bench, LeaseAction::kAcquire, kOwner);
    }
  }
}

// Catches: a watchdog that latches one axis, a clear of one, a second axis that can be driven with a latch.
TEST(BenchSharedAmplifier, LatchesAndClearsAreThoseOfBoth) {
  Bench bench = owned_bench(shared_setup(), kOwner);
  drive(bench, 10);
  step(bench, 30);
  for (std::size_t axis : {0u, 1u}) {
    EXPECT_TRUE(bench.is_latched(axis)) << axis;
    EXPECT_EQ(bench.sample(axis).state, static_cast<std::uint64_t>(ControlState::kTimeout)) << axis;
  }
  EXPECT_FALSE(bench.is_latched(2));
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
  EXPECT_FALSE(bench.is_latched(0) || bench.is_latched(1));
}

// The sum lasts while the gates are off only as long as it flows. Catches: a clear that looks at one of the
// two currents.
TEST(BenchSharedAmplifier, TheTripOfTheSumIsClearedWhenTheSumIsGone) {
  BenchSetup setup = shared_setup();
  setup.axes[0].parameters.drive.amplifier.over_current_a = 3.0;
  Bench bench = owned_bench(setup, kOwner);
  for (int i = 0; i < 40 && !bench.is_latched(0); ++i)
    drive(bench, 1);
  ASSERT_NE(bench.sample(1).faults & kOverCurrentTrip, 0u);
  EXPECT_LT(std::abs(bench.sample(0).true_i_a_a), 3.0);
  step(bench, 50);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
}

// Catches: a parameter of the drive that changes for one machine, that is taken for the second axis, or that
// breaks what two machines need; other parameters that are refused with it.
TEST(BenchSharedAmplifier, TheDriveIsThatOfTheFirstAxis) {
  Bench bench = owned_bench(shared_setup(), kOwner);
  const AxisParameters& p = servo_axis();
  EXPECT_EQ(submit_to(bench, 0, write_of(p, "amplifier.gain", 0.5)), Refused::kNot);
  EXPECT_EQ(bench.axis(1).parameters().drive.amplifier.gain, 0.5);
  EXPECT_EQ(submit_to(bench, 1, write_of(p, "amplifier.gain", 0.7)), Refused::kSharedAmplifier);
  EXPECT_EQ(submit_to(bench, 0, write_of(p, "amplifier.filter_hz", 100.0)), Refused::kRuleBroken);
  EXPECT_EQ(submit_to(bench, 2, write_of(p, "amplifier.filter_hz", 100.0)), Refused::kNotOwner);
  EXPECT_EQ(submit_to(bench, 1, write_of(p, "machine.rotor_resistance_ohm", 5.0)), Refused::kNot);
  for (const InjectableFault& fault : kInjectableFaults) {
    const auto row = static_cast<std::uint32_t>(&fault - kInjectableFaults.data());
    const Refused why = submit_to(bench, 1, InjectFault{.row = row, .value = 0.0});
    EXPECT_EQ(why, is_of_drive(fault) ? Refused::kSharedAmplifier : Refused::kNot) << fault.name;
  }
}

// Catches: a state of the pair that is not saved, a state of two amplifiers that is taken for it, a pair
// whose hash is that of two amplifiers; drive parameters of the second axis that count.
TEST(BenchSharedAmplifier, IsSavedAndRestored) {
  Bench original = owned_bench(shared_setup(), kOwner);
  drive(original, 100);
  submit_to(original, 0, write_of(servo_axis(), "amplifier.gain", 0.5));
  Bench copy(shared_setup());
  ASSERT_TRUE(copy.restore(original.save()));
  step(original, 200);  // the watchdog, then the gates off
  step(copy, 200);
  EXPECT_EQ(copy.state_hash(), original.state_hash());
  BenchSetup apart = shared_setup();
  apart.axes[1].shares_amplifier_with.reset();
  EXPECT_FALSE(Bench(apart).restore(original.save()));
  BenchSetup other_drive = shared_setup();
  other_drive.axes[1].parameters.drive.amplifier.gain = 3.0;
  EXPECT_EQ(Bench(other_drive).axis(1).parameters().drive.amplifier.gain, 1.0);
}

// Catches: loads of the second axis that stay scheduled when the controller has gone.
TEST(BenchSharedAmplifier, WhatTheOwnerScheduledForTheSecondAxisGoesWithTheLease) {
  Bench bench = owned_bench(shared_setup(), kOwner);
  EXPECT_EQ(
      bench.submit(
          {.tick = 5, .axis = 1, .owner = kOwner, .action = LoadChange{.load_nm = 1.0, .ramp_ticks = 0}}),
      Refused::kNot);
  EXPECT_EQ(submit_to(bench, 1, LoadChange{.load_nm = 2.0, .ramp_ticks = 0}, 8), Refused::kNotOwner);
  submit_lease(bench, LeaseAction::kRelease, kOwner);
  step(bench, 10);
  EXPECT_EQ(bench.sample(1).load_nm, 0.0);
}

}  // namespace
}  // namespace drivebench::bench_shared_amplifier_test
