#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "protocols/signals/catalogue.hpp"
#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::bench_trigger_test {
namespace {

/// A condition on the load torque, which a test can set to the tick.
Trigger load_above(double load_nm, Tick for_ticks = 0) {
  return {.axis = 0,
          .condition = {.signal = static_cast<std::uint64_t>(find_signal("load_nm") - kSignals.data()),
                        .comparison = Comparison::kAbove,
                        .number = load_nm},
          .for_ticks = for_ticks};
}

Input bus_sag(Tick delay, double value = 0.25) {
  return {.tick = delay, .axis = 0, .owner = 0, .action = fault_of("bus_sag", value)};
}

void set_load_at(Bench& bench, Tick tick, double load_nm) {
  bench.submit({.tick = tick, .axis = 0, .owner = 0, .action = LoadChange{load_nm, 0}});
}

bool is_sagging(const Bench& bench) {
  return bench.axis(0).injected().bus_sag != 0.0;
}

/// The tick at whose start the sag begins: it shows when that tick has run.
Tick tick_of_sag(Bench& bench) {
  while (!is_sagging(bench) && bench.tick() < 100)
    bench.step();
  return bench.tick() - 1;
}

class Inputs final : public BenchObserver {
 public:
  void on_input(Tick now, const Input& input) noexcept override { seen.emplace_back(now, input); }
  void on_sample(std::uint32_t, const Sample&) noexcept override {}
  std::vector<std::pair<Tick, Input>> seen;
};

// Catches: a trigger that sees the sample before or after the one that shows its condition, a delay that
// counts from elsewhere.
TEST(BenchTrigger, ActsInTheTickOfItsSampleOrLater) {
  for (const Tick delay : {0, 1, 7}) {
    Bench bench(servo_setup());
    bench.await(load_above(0.5), bus_sag(delay));
    set_load_at(bench, 10, 1.0);
    EXPECT_EQ(bench.triggered_at(0), -1);
    const Tick acted = tick_of_sag(bench);
    EXPECT_EQ(bench.triggered_at(0), 11) << "tick 10 sets the load, and sample 11 is the first that shows it";
    EXPECT_EQ(acted, 11 + delay);
  }
}

// Catches: a hold that counts from the first sample ever, or goes on across a gap.
TEST(BenchTrigger, TheConditionMustHoldInOnePiece) {
  Bench bench(servo_setup());
  bench.await(load_above(0.5, 3), bus_sag(0));
  set_load_at(bench, 10, 1.0);  // in samples 11, 12, 13
  set_load_at(bench, 13, 0.0);
  set_load_at(bench, 20, 1.0);  // in samples 21, 22, 23, 24
  EXPECT_EQ(tick_of_sag(bench), 24);
}

// Catches: the sample of tick 0, which no step makes, overlooked.
TEST(BenchTrigger, TickZeroCounts) {
  Bench bench(servo_setup());
  Trigger at_rest = load_above(0.0);
  at_rest.condition.comparison = Comparison::kEqual;
  bench.await(at_rest, bus_sag(0));
  EXPECT_EQ(tick_of_sag(bench), 0);
}

// Catches: an event that comes again whenever its condition returns.
TEST(BenchTrigger, HappensOnce) {
  Inputs inputs;
  Bench bench(servo_setup(), &inputs);
  bench.await(load_above(0.5), bus_sag(0));
  for (const Tick tick : {10, 30}) {
    set_load_at(bench, tick, 1.0);
    set_load_at(bench, tick + 10, 0.0);
  }
  step(bench, 50);
  ASSERT_EQ(inputs.seen.size(), 5u);
  EXPECT_EQ(inputs.seen.back().first, 11);
  EXPECT_EQ(inputs.seen.back().second.tick, 11);
}

// Catches: an event that a recording lacks or has elsewhere, and a hash that only the original run has.
TEST(BenchTrigger, TheRecordedInputsRepeatTheRun) {
  Inputs inputs;
  Bench bench(servo_setup(), &inputs);
  bench.await(load_above(0.5), bus_sag(4));
  set_load_at(bench, 10, 1.0);
  step(bench, 30);
  Bench replay(servo_setup());
  for (const auto& [received, input] : inputs.seen) {
    while (replay.tick() < received)
      replay.step();
    replay.repeat(input);
  }
  while (replay.tick() < bench.tick())
    replay.step();
  EXPECT_TRUE(is_sagging(replay));
  EXPECT_EQ(replay.state_hash(), bench.state_hash());
}

// Catches: a saved state that forgets how long a condition has held or that its event has happened, and one
// that is taken by a bench with another trigger.
TEST(BenchTrigger, IsSavedAndRestored) {
  const auto make = [](Tick for_ticks) {
    Bench bench(servo_setup());
    bench.await(load_above(0.5, for_ticks), bus_sag(0));
    set_load_at(bench, 10, 1.0);
    return bench;
  };
  for (const int saved_at : {14, 30}) {
    Bench bench = make(5);
    step(bench, saved_at);
    const std::vector<std::byte> saved = bench.save();
    step(bench, 40 - saved_at);
    Bench other = make(5);
    ASSERT_TRUE(other.restore(saved));
    step(other, 40 - saved_at);
    EXPECT_EQ(other.triggered_at(0), 16);
    EXPECT_EQ(other.state_hash(), bench.state_hash());
    EXPECT_EQ(other.save(), bench.save());
    Bench stranger = make(6);
    EXPECT_FALSE(stranger.restore(saved));
  }
}

// Catches: an event that the bench cannot carry out, dropped without a word.
TEST(BenchTrigger, WhatCannotBeDoneIsCounted) {
  Bench bench(servo_setup());
  bench.await(load_above(0.5), bus_sag(0, 2.0));  // a sag of more than all
  set_load_at(bench, 10, 1.0);
  step(bench, 20);
  EXPECT_EQ(bench.sample(0).refused_commands, 1u);
}

}  // namespace
}  // namespace drivebench::bench_trigger_test
