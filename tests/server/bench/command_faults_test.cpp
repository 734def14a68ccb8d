// Faults of a stream of commands: lost, late, doubled, overtaken, in a burst, not numbers.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "tests/server/bench/servo_bench.hpp"

namespace drivebench {
namespace {

constexpr Owner kOwner = 7;
constexpr Tick kWatchdog = 20;

BenchSetup watched_setup(int command_delay_ticks = 0) {
  BenchSetup setup = servo_setup(command_delay_ticks);
  setup.watchdog_ticks = kWatchdog;
  return setup;
}

Refused submit_answer(Bench& bench, Tick answers, double a_v) {
  return bench.submit(
      {.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = volts_in_answer_to(answers, a_v)});
}

std::uint64_t bits(double value) {
  return std::bit_cast<std::uint64_t>(value);
}

// Catches: a loss that changes the voltage, that is counted wrongly, or that must be cleared.
TEST(CommandFaults, CMD_01_LostCommandsHoldTheVoltageAndTheStreamGoesOn) {
  Bench bench = owned_bench(watched_setup(), kOwner);
  std::uint64_t missed = 0;
  for (Tick lost = 1; lost < kWatchdog; ++lost) {
    const double volts = 0.1 * static_cast<double>(lost);
    ASSERT_EQ(submit_volts(bench, kOwner, volts, -volts), Refused::kNot);
    bench.step();
    ASSERT_EQ(state_of(bench), ControlState::kRun);
    for (Tick i = 0; i < lost; ++i) {
      bench.step();
      ASSERT_EQ(state_of(bench), ControlState::kHold);
      ASSERT_EQ(bits(bench.sample(0).u_a_v), bits(volts));
      ASSERT_EQ(bits(bench.sample(0).u_b_v), bits(-volts));
      ASSERT_EQ(bench.sample(0).missed_commands, ++missed);
    }
    ASSERT_EQ(bench.sample(0).faults, 0u);
  }
}

// Catches: a late command that is thrown away, waits for a tick of its own or acts twice; the older one of
// two that wins.
TEST(CommandFaults, CMD_05_ALateCommandActsInTheNextTickAndTheNewestWins) {
  Bench bench = owned_bench(watched_setup(), kOwner);
  ASSERT_EQ(submit_answer(bench, 0, 1.0), Refused::kNot);
  step(bench, 3);
  ASSERT_EQ(submit_answer(bench, 1, 2.0), Refused::kNot);  // two periods late
  bench.step();
  EXPECT_EQ(bench.sample(0).u_a_v, 2.0);
  EXPECT_EQ(bench.sample(0).command_age_ticks, 2u);
  ASSERT_EQ(submit_answer(bench, 2, 3.0), Refused::kNot);
  ASSERT_EQ(submit_answer(bench, 4, 4.0), Refused::kNot);  // both before the same tick
  EXPECT_EQ(submit_answer(bench, 3, 5.0), Refused::kStale);
  bench.step();
  EXPECT_EQ(bench.sample(0).u_a_v, 4.0);
  EXPECT_EQ(state_of(bench), ControlState::kRun);
  bench.step();
  EXPECT_EQ(state_of(bench), ControlState::kHold) << "none is left over for this tick";
}

// Catches: a stuck sender that keeps the axis alive by repeating one command.
TEST(CommandFaults, CMD_06_CMD_08_ARepeatedCommandFeedsNoWatchdog) {
  Bench bench = owned_bench(watched_setup(), kOwner);
  ASSERT_EQ(submit_answer(bench, 0, 1.0), Refused::kNot);
  bench.step();
  for (Tick i = 1; i < kWatchdog; ++i) {
    ASSERT_EQ(submit_answer(bench, 0, 1.0), Refused::kStale);
    bench.step();
    ASSERT_EQ(bench.sample(0).faults, 0u);
  }
  ASSERT_EQ(submit_answer(bench, 0, 1.0), Refused::kStale);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, kCommandTimeout);
  EXPECT_EQ(bench.sample(0).refused_commands, static_cast<std::uint64_t>(kWatchdog));
}

// Catches: a controller that holds its voltage and is taken for dead.
TEST(CommandFaults, CMD_08_ASteadyVoltageWithARunningCounterIsACommand) {
  Bench bench = owned_bench(watched_setup(), kOwner);
  for (Tick i = 0; i < 10 * kWatchdog; ++i) {
    ASSERT_EQ(submit_volts(bench, kOwner, 1.0), Refused::kNot);
    bench.step();
    ASSERT_EQ(state_of(bench), ControlState::kRun);
  }
  EXPECT_EQ(bench.sample(0).missed_commands, 0u);
}

// Catches: an old command that undoes a newer one, however far it was overtaken.
TEST(CommandFaults, CMD_07_OvertakenCommandsAreDroppedAndCounted) {
  for (Tick distance = 1; distance <= 8; ++distance) {
    Bench bench = owned_bench(watched_setup(), kOwner);
    step(bench, 10);
    ASSERT_EQ(submit_answer(bench, 10, 5.0), Refused::kNot);
    EXPECT_EQ(submit_answer(bench, 10 - distance, 9.0), Refused::kStale);
    bench.step();
    EXPECT_EQ(bench.sample(0).u_a_v, 5.0);
    EXPECT_EQ(bench.sample(0).refused_commands, 1u);
  }
}

// Catches: a queue of old commands that is played back, or a burst that leaves something behind.
TEST(CommandFaults, CMD_09_CMD_10_OfABurstTheNewestActsOnce) {
  for (const int delay : {0, 1}) {
    BenchSetup setup = watched_setup(delay);
    setup.watchdog_ticks = 5000;
    Bench bench = owned_bench(setup, kOwner);
    ASSERT_EQ(submit_volts(bench, kOwner, 1.0), Refused::kNot);
    step(bench, 1001);  // the stall
    for (Tick answers = 1; answers <= 1000; ++answers)
      ASSERT_EQ(submit_answer(bench, answers, 0.001 * static_cast<double>(answers)), Refused::kNot);
    EXPECT_EQ(submit_answer(bench, 1002, 9.0), Refused::kStale) << "from the future";
    step(bench, 1 + delay);
    EXPECT_EQ(bench.sample(0).u_a_v, 1.0);
    EXPECT_EQ(bench.sample(0).command_tick, 1000);
    const std::uint64_t missed = bench.sample(0).missed_commands;
    step(bench, 3);
    EXPECT_EQ(bench.sample(0).u_a_v, 1.0) << "nothing of the past comes back";
    EXPECT_EQ(bench.sample(0).missed_commands, missed + 3);
  }
}

// Catches: one set-point of the four that is not checked; a refusal that changes what is in force or feeds
// the watchdog; a check that takes a negative zero or a denormal for wrong, or flushes it.
TEST(CommandFaults, CMD_11_EveryFieldIsCheckedAndLegalOdditiesPass) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (double PhaseValues::*field :
       {&PhaseValues::a, &PhaseValues::b, &PhaseValues::c, &PhaseValues::field}) {
    Bench bench = owned_bench(watched_setup(), kOwner);
    ASSERT_EQ(submit_volts(bench, kOwner, 3.0, 4.0), Refused::kNot);
    bench.step();
    for (const double bad : {std::nan(""), -std::nan(""), kInfinity, -kInfinity}) {
      Command command = volts_in_answer_to(bench.tick(), 1.0, 2.0);
      command.phases.setpoint.*field = bad;
      EXPECT_EQ(bench.submit({.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = command}),
                Refused::kNotFinite);
      bench.step();
      EXPECT_EQ(state_of(bench), ControlState::kHold);
      EXPECT_EQ(bench.sample(0).u_a_v, 3.0);
      EXPECT_EQ(bench.sample(0).u_b_v, 4.0);
    }
    EXPECT_EQ(bench.sample(0).missed_commands, 4u);
    EXPECT_EQ(bench.sample(0).refused_commands, 4u);
  }
  Bench bench = owned_bench(watched_setup(), kOwner);
  for (const double odd : {-0.0, std::numeric_limits<double>::denorm_min(), -1e-310}) {
    ASSERT_EQ(submit_volts(bench, kOwner, odd, odd), Refused::kNot);
    bench.step();
    EXPECT_EQ(bench.sample(0).u_a_v, odd);  // the mean over a tick has no negative zero
  }
}

}  // namespace
}  // namespace drivebench
