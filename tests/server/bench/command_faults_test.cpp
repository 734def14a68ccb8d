// Faults of a stream of commands: lost, late, doubled, overtaken, in a burst, not numbers.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "protocols/signals/catalogue.hpp"
#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::command_faults_test {
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

/// A bench whose drive takes set-points of this kind.
BenchSetup setup_for(Gates gates) {
  BenchSetup setup = watched_setup();
  if (gates != Gates::kCurrent) return setup;
  DriveParameters& drive = setup.axes[0].parameters.drive;
  drive.kind = DriveKind::kCurrent;
  drive.amplifier.voltage_limit_v = 80.0;
  drive.current_loop = {.proportional_v_per_a = 50.0, .integral_v_per_as = 5e4, .limit_a = 6.0};
  setup.substeps = 7;  // of 17.9 us
  return setup;
}

Refused submit_setpoint(Bench& bench, Gates gates, const PhaseValues& setpoint) {
  const Command command{.answers = bench.tick(), .phases = {.gates = gates, .setpoint = setpoint}};
  return bench.submit({.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = command});
}

constexpr auto kSetpoints =
    std::to_array({&PhaseValues::a, &PhaseValues::b, &PhaseValues::c, &PhaseValues::field});

// Catches: a voltage or a current that is not checked; a refusal that changes what is in force, that feeds
// the watchdog, or that leaves a trace in a current, a voltage or the loop that controls a current.
TEST(CommandFaults, CMD_11_NoVoltageOrCurrentThatIsNoNumberReachesThePlant) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const Gates gates : {Gates::kVoltage, Gates::kCurrent}) {
    for (double PhaseValues::*field : kSetpoints) {
      Bench bench = owned_bench(setup_for(gates), kOwner);
      Bench silent = owned_bench(setup_for(gates), kOwner);
      for (Bench* b : {&bench, &silent}) {
        ASSERT_EQ(submit_setpoint(*b, gates, {.a = 3.0, .b = -2.0}), Refused::kNot);
        b->step();
      }
      for (const double bad : {std::nan(""), -std::nan(""), kInfinity, -kInfinity, 1e308, -1e308}) {
        PhaseValues setpoint{.a = 1.0, .b = 2.0};
        setpoint.*field = bad;
        EXPECT_EQ(submit_setpoint(bench, gates, setpoint),
                  std::isfinite(bad) ? Refused::kBeyondDrive : Refused::kNotFinite);
        EXPECT_FALSE(bench.has_command(0));
        bench.step();
        silent.step();
        EXPECT_EQ(state_of(bench), ControlState::kHold);
        for (const Signal& signal : kSignals) {
          if (signal.type != SignalType::kReal) continue;
          EXPECT_EQ(bits(bench.sample(0).*signal.as_real), bits(silent.sample(0).*signal.as_real))
              << signal.name;
        }
      }
      EXPECT_GT(std::abs(bench.sample(0).true_i_a_a), 0.1) << "currents that a trace would change";
      EXPECT_EQ(bench.sample(0).missed_commands, 6u);
      EXPECT_EQ(bench.sample(0).refused_commands, 6u);
    }
  }
}

/// Keeps the set-points of the last command as a recorder gets them.
class LastSetpoints final : public BenchObserver {
 public:
  void on_input(Tick, const Input& input) noexcept override {
    if (const auto* command = std::get_if<Command>(&input.action)) values = command->phases.setpoint;
  }
  void on_sample(std::uint32_t, const Sample&) noexcept override {}
  PhaseValues values{};
};

// Catches: a check that takes a negative zero or a denormal for wrong, or flushes it.
TEST(CommandFaults, CMD_11_NegativeZerosAndDenormalsAreLegalAndKeepTheirBits) {
  for (const Gates gates : {Gates::kVoltage, Gates::kCurrent}) {
    for (double PhaseValues::*field : kSetpoints) {
      LastSetpoints last;
      Bench bench = owned_bench(setup_for(gates), kOwner, &last);
      for (const double odd : {-0.0, std::numeric_limits<double>::denorm_min(), -1e-310}) {
        PhaseValues setpoint{};
        setpoint.*field = odd;
        ASSERT_EQ(submit_setpoint(bench, gates, setpoint), Refused::kNot);
        EXPECT_EQ(bits(last.values.*field), bits(odd));
        bench.step();
        EXPECT_EQ(state_of(bench), ControlState::kRun);
        EXPECT_TRUE(std::isfinite(bench.sample(0).true_i_a_a));
        const double applied_v = gates == Gates::kVoltage ? setpoint.a : bench.sample(0).u_a_v;
        EXPECT_EQ(bench.sample(0).u_a_v, applied_v);  // the mean over a tick has no negative zero
      }
    }
  }
}

}  // namespace
}  // namespace drivebench::command_faults_test
