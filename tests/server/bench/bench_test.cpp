#include "server/bench/bench.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::bench_test {
namespace {

constexpr Owner kOwner = 7;
constexpr Owner kOther = 8;

// Catches: a command that acts a tick early or late, a sample that names the wrong command or age.
TEST(Bench, TheCommandDelayIsExactlyItsTicks) {
  for (const int delay : {0, 1}) {
    Bench bench = owned_bench(servo_setup(delay), kOwner);
    step(bench, 10);
    for (Tick tick = 10; tick < 15; ++tick) {
      ASSERT_EQ(submit_volts(bench, kOwner, static_cast<double>(tick)), Refused::kNot);
      EXPECT_TRUE(bench.has_command(0));
      bench.step();
      EXPECT_FALSE(bench.has_command(0));
      const Sample& s = bench.sample(0);
      const Tick used = tick - delay;
      EXPECT_EQ(s.tick, static_cast<std::uint64_t>(tick + 1));
      EXPECT_EQ(s.u_a_v, used < 10 ? 0.0 : static_cast<double>(used));
      EXPECT_EQ(s.command_tick, used < 10 ? -1 : used);
      EXPECT_EQ(s.command_age_ticks, used < 10 ? 0u : static_cast<std::uint64_t>(delay));
      EXPECT_EQ(s.state, static_cast<std::uint64_t>(ControlState::kRun));
    }
  }
}

// Catches: a freewheeling tick between the safe action and the first command of a delayed bench.
TEST(Bench, TheSafeActionLastsUntilTheFirstCommandIsInForce) {
  BenchSetup setup = servo_setup(1);
  setup.axes[0].on_link_loss = SafeAction::kZeroVoltage;
  setup.axes[0].parameters.drive.amplifier.voltage_limit_v = 5.0;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 4.0);
  step(bench, 4);  // builds up a current, and holds
  const double current_a = bench.sample(0).true_i_a_a;
  ASSERT_GT(current_a, 0.1);
  submit_lease(bench, LeaseAction::kRelease, kOwner);
  bench.step();
  EXPECT_EQ(bench.sample(0).u_a_v, 0.0);
  submit_lease(bench, LeaseAction::kAcquire, kOther);
  submit_volts(bench, kOther, 4.0);
  bench.step();
  EXPECT_EQ(bench.sample(0).u_a_v, 0.0);  // -5 V with the gates off
  bench.step();
  EXPECT_EQ(bench.sample(0).u_a_v, 4.0);
}

// Catches: the newest answer overtaken by an older one, a tick whose command can be replaced, answers from
// the future.
TEST(Bench, CMD_06_CMD_07_StaleDuplicateAndFutureAnswersAreRefusedAndCounted) {
  Bench bench = owned_bench(servo_setup(), kOwner);
  step(bench, 10);
  const auto submit = [&](Tick answers) {
    return bench.submit(
        {.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = volts_in_answer_to(answers, 1.0)});
  };
  EXPECT_EQ(submit(11), Refused::kStale);
  EXPECT_EQ(submit(-1), Refused::kStale);
  EXPECT_EQ(submit(8), Refused::kNot);
  EXPECT_EQ(submit(8), Refused::kStale);
  EXPECT_EQ(submit(7), Refused::kStale);
  EXPECT_EQ(submit(10), Refused::kNot);  // the newest one counts
  bench.step();
  EXPECT_EQ(bench.sample(0).command_tick, 10);
  EXPECT_EQ(bench.sample(0).refused_commands, 4u);
}

// Catches: NaN in the plant, a refusal that is not counted or that feeds the watchdog or the lease.
TEST(Bench, CMD_11_CMD_12_ACommandThatIsNotFiniteNeverReachesThePlant) {
  Bench bench = owned_bench(servo_setup(), kOwner);
  Bench silent = owned_bench(servo_setup(), kOwner);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (Bench* b : {&bench, &silent}) {
    submit_volts(*b, kOwner, 3.0);
    b->step();
  }
  EXPECT_EQ(submit_volts(bench, kOwner, kNan, 0.0), Refused::kNotFinite);
  EXPECT_EQ(submit_volts(bench, kOwner, 0.0, kNan), Refused::kNotFinite);
  EXPECT_EQ(submit_volts(bench, kOwner, kInfinity, 0.0), Refused::kNotFinite);
  EXPECT_EQ(submit_volts(bench, kOwner, 0.0, -kInfinity), Refused::kNotFinite);
  EXPECT_FALSE(bench.has_command(0));
  for (Bench* b : {&bench, &silent})
    b->step();
  EXPECT_EQ(bench.sample(0).refused_commands, 4u);
  EXPECT_EQ(bench.sample(0).missed_commands, 1u);
  EXPECT_EQ(bench.sample(0).true_i_a_a, silent.sample(0).true_i_a_a);
  EXPECT_EQ(submit_volts(bench, kOwner, 3.0), Refused::kNot);  // its tick is not used up
  EXPECT_EQ(bench.submit({.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = RefusedCommand{}}),
            Refused::kNot);
  bench.step();
  EXPECT_EQ(bench.sample(0).refused_commands, 5u);
}

// Catches: a load that makes the plant diverge.
TEST(Bench, ALoadThatIsNotFiniteIsRefused) {
  Bench bench(servo_setup());
  const LoadChange load{.load_nm = std::numeric_limits<double>::quiet_NaN(), .ramp_ticks = 0};
  EXPECT_EQ(bench.submit({.tick = 0, .axis = 0, .owner = 0, .action = load}), Refused::kNotFinite);
  step(bench, 2);
  EXPECT_EQ(bench.sample(0).faults, 0u);
}

// Catches: an overrun that some axes survive, or that goes away.
TEST(Bench, AnOverrunLatchesEveryAxis) {
  BenchSetup setup = servo_setup();
  setup.axes.push_back(setup.axes[0]);
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 5.0);
  bench.step();
  bench.submit({.tick = bench.tick(), .axis = 0, .owner = 0, .action = Overrun{}});
  step(bench, 10);
  for (const std::size_t axis : {0u, 1u}) {
    EXPECT_EQ(bench.sample(axis).faults, kBenchOverrun);
    EXPECT_EQ(bench.sample(axis).state, static_cast<std::uint64_t>(ControlState::kFault));
    EXPECT_EQ(bench.sample(axis).late_ticks, 1u);
  }
  EXPECT_EQ(submit_volts(bench, kOwner, 1.0), Refused::kLatched);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(bench.sample(1).faults, kBenchOverrun);
}

// Catches: a trip whose state the sample does not show, or that a command undoes.
TEST(Bench, AnOverCurrentTripIsAFaultUntilCleared) {
  BenchSetup setup = servo_setup();
  setup.axes[0].parameters.drive.amplifier.over_current_a = 1.0;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 100.0);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, kOverCurrent | kOverCurrentTrip);
  EXPECT_EQ(submit_volts(bench, kOwner, 1.0), Refused::kLatched);
  bench.step();
  EXPECT_EQ(state_of(bench), ControlState::kFault);
  EXPECT_EQ(bench.sample(0).faults, kOverCurrentTrip);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
  EXPECT_EQ(submit_volts(bench, kOwner, 1.0), Refused::kNot);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(state_of(bench), ControlState::kRun);
}

Refused submit_load(Bench& bench, Tick tick, double load_nm, Tick ramp_ticks = 0) {
  const LoadChange load{.load_nm = load_nm, .ramp_ticks = ramp_ticks};
  return bench.submit({.tick = tick, .axis = 0, .owner = 0, .action = load});
}

// Catches: an input that acts a tick early or late, or in the order of arrival in place of that of the ticks.
TEST(Bench, ScheduledInputsActAtTheirTickInOrder) {
  Bench bench(servo_setup());
  submit_load(bench, 30, 0.3);
  submit_load(bench, 10, 0.1);
  submit_load(bench, 20, 0.9);
  submit_load(bench, 20, 0.2);  // same tick: the later one comes later
  for (Tick tick = 0; tick < 40; ++tick) {
    const double speed_before = bench.sample(0).speed_rad_s;
    bench.step();
    // The sample after tick k shows the load of tick k + 1 as known by then; the shaft felt that of tick k.
    const double load_nm = tick < 10 ? 0.0 : tick < 20 ? 0.1 : tick < 30 ? 0.2 : 0.3;
    EXPECT_EQ(bench.sample(0).load_nm, load_nm);
    // Within 1 %: viscous friction brakes a little as well.
    EXPECT_NEAR(bench.sample(0).speed_rad_s - speed_before, -load_nm / kServoInertia_kgm2 * kServoTick_s,
                0.01 * load_nm / kServoInertia_kgm2 * kServoTick_s);
  }
}

// Catches: a queue that grows, overwrites or forgets to make room.
TEST(Bench, TheScheduleIsBoundedAndMakesRoomAgain) {
  Bench bench(servo_setup());
  for (std::size_t i = 0; i < Bench::kMaxScheduled; ++i) {
    ASSERT_EQ(submit_load(bench, 5 + static_cast<Tick>(i % 3), 0.01 * static_cast<double>(i)), Refused::kNot);
  }
  EXPECT_EQ(submit_load(bench, 4, 9.0), Refused::kBusy);
  EXPECT_EQ(submit_load(bench, 0, 0.5), Refused::kNot);  // those of the present tick need no room
  step(bench, 6);
  EXPECT_EQ(bench.sample(0).load_nm, 0.01 * 255);  // the last one of tick 5: 255 is a multiple of 3
  EXPECT_EQ(submit_load(bench, 100, 0.7), Refused::kNot);
  step(bench, 2);
  EXPECT_EQ(bench.sample(0).load_nm, 0.01 * 254);
  step(bench, 93);
  EXPECT_EQ(bench.sample(0).load_nm, 0.7);
}

// Catches: a parameter write that acts at submission, on another row, or not at all.
TEST(Bench, AParameterWriteActsAtItsTick) {
  Bench bench(servo_setup());
  const std::string name = "machine.rotor_resistance_ohm";
  bench.submit({.tick = 3, .axis = 0, .owner = 0, .action = write_of(servo_axis(), name, 5.85)});
  step(bench, 3);
  EXPECT_EQ(value_of(bench.axis(0).parameters(), name), 3.9);
  bench.step();
  EXPECT_EQ(value_of(bench.axis(0).parameters(), name), 5.85);
}

class Listener final : public BenchObserver {
 public:
  void on_input(Tick now, const Input& input) noexcept override { inputs.push_back({now, input.tick}); }
  void on_sample(std::uint32_t axis, const Sample& s) noexcept override { samples.push_back({axis, s.tick}); }
  std::vector<std::pair<Tick, Tick>> inputs;
  std::vector<std::pair<std::uint32_t, std::uint64_t>> samples;
};

// Catches: samples or inputs that the recorder does not see, or sees twice; a late input with its old tick.
TEST(Bench, TheObserverSeesEveryInputWithItsTickAndEverySample) {
  Listener listener;
  BenchSetup setup = servo_setup();
  setup.axes.push_back(setup.axes[0]);
  Bench bench(setup, &listener);
  bench.step();
  submit_load(bench, 0, 0.1);  // too late for tick 0: acts in tick 1
  submit_load(bench, 2, 0.1);
  step(bench, 2);
  using Inputs = decltype(listener.inputs);
  using Samples = decltype(listener.samples);
  EXPECT_EQ(listener.inputs, (Inputs{{1, 1}, {1, 2}}));
  EXPECT_EQ(listener.samples, (Samples{{0, 0}, {1, 0}, {0, 1}, {1, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}}));
}

}  // namespace
}  // namespace drivebench::bench_test
