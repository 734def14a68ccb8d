// The states of an axis under random losses, beside a state machine that fits on a screen.
#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <random>

#include "tests/repetitions.hpp"
#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::control_states_test {
namespace {

constexpr Owner kOwner = 7;

/// The reference: the state in each tick, and the voltage in force, if any.
struct Reference {
  Tick watchdog_ticks;
  std::int64_t arming_commands;
  int delay;
  ControlState state = ControlState::kIdle;
  Tick silent = 0;
  std::int64_t good = 0;
  std::uint64_t missed = 0;
  std::optional<double> sent = std::nullopt;      // since the last tick
  std::optional<double> in_force = std::nullopt;  // none: the safe action
  bool latched = false;

  bool command(double volts) {
    if (!latched) sent = volts;
    return !latched;
  }
  void clear() {
    if (!latched) return;
    latched = false;
    state = ControlState::kIdle;
    silent = good = 0;
  }
  void bad_command() { good = 0; }
  /// The voltage of this tick.
  std::optional<double> tick(bool late) {
    const bool armed = state == ControlState::kRun || state == ControlState::kHold;
    if (sent) {
      state = armed || ++good >= arming_commands ? ControlState::kRun : ControlState::kReady;
      silent = 0;
    } else if (state == ControlState::kReady && !late) {
      if (++silent >= watchdog_ticks) state = ControlState::kIdle, good = 0;
    } else if (armed && !late) {
      state = ControlState::kHold;
      ++missed;
      latched = ++silent >= watchdog_ticks;
    }
    if (latched) {
      state = ControlState::kTimeout;
      in_force.reset();
    }
    const std::optional<double> before = in_force;
    if (sent && state == ControlState::kRun) in_force = sent;
    sent.reset();
    return delay == 0 ? in_force : before;
  }
};

// Catches: any state, count or voltage that depends on more than which commands came in which tick.
TEST(ControlStates, STATE_01_AgreeWithTheReferenceInEveryPatternOfLosses) {
  std::mt19937_64 random(19);
  const auto chance = [&random](double p) { return std::bernoulli_distribution(p)(random); };
  const BenchSetup servo = servo_setup();
  std::size_t timeouts = 0;
  std::size_t readied = 0;
  for (int pattern = 0; pattern < repetitions(100'000); ++pattern) {
    BenchSetup setup = servo;
    setup.substeps = 1;
    setup.command_delay_ticks = pattern % 2;
    setup.watchdog_ticks = 1 + static_cast<Tick>(random() % 6);
    setup.arming_commands = pattern % 3 == 0 ? 1 : 1 + static_cast<std::int64_t>(random() % 12);
    setup.axes[0].on_link_loss = SafeAction::kZeroVoltage;  // a voltage that the sample shows
    Bench bench = owned_bench(setup, kOwner);
    Reference reference{.watchdog_ticks = setup.watchdog_ticks,
                        .arming_commands = setup.arming_commands,
                        .delay = setup.command_delay_ticks};
    const double arriving = std::uniform_real_distribution(0.1, 1.0)(random);
    for (int tick = 0; tick < 24; ++tick) {
      const bool late = chance(0.05);
      if (late) bench.submit({.tick = bench.tick(), .axis = 0, .owner = 0, .action = LateTick{}});
      if (chance(0.1)) {
        ASSERT_EQ(submit_clear(bench, kOwner), Refused::kNot);
        reference.clear();
      }
      if (chance(arriving)) {
        const double volts = 1.0 + 0.125 * tick;
        ASSERT_EQ(submit_volts(bench, kOwner, volts) == Refused::kNot, reference.command(volts));
      }
      if (chance(0.05)) {
        bench.submit({.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = RefusedCommand{}});
        reference.bad_command();
      }
      const bool was_latched = reference.latched;
      const std::optional<double> volts = reference.tick(late);
      timeouts += reference.latched && !was_latched ? 1 : 0;
      bench.step();
      readied += state_of(bench) == ControlState::kReady ? 1u : 0u;
      ASSERT_EQ(state_of(bench), reference.state) << "pattern " << pattern << ", tick " << tick;
      ASSERT_EQ(bench.sample(0).u_a_v, volts.value_or(0.0)) << "pattern " << pattern << ", tick " << tick;
      ASSERT_EQ(bench.sample(0).missed_commands, reference.missed);
      ASSERT_EQ(bench.sample(0).faults, reference.latched ? kCommandTimeout : 0u);
    }
  }
  EXPECT_GT(timeouts, repetitions(10'000u)) << "patterns that reach the timeout";
  EXPECT_GT(readied, repetitions(100'000u));
}

}  // namespace
}  // namespace drivebench::control_states_test
