// The lease of an axis, and the watchdog of its commands.
#include <gtest/gtest.h>

#include <limits>

#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::bench_lease_test {
namespace {

constexpr Owner kOwner = 7;
constexpr Owner kOther = 8;

// Last command in tick 10, watchdog of 5: held in ticks 11 to 14, safe from tick 15 on. Catches: an
// off-by-one, a fault that clears itself, a hold at zero volts.
TEST(BenchLease, CMD_02_LIMIT_07_TheWatchdogActsExactlyItsTicksAfterTheLastCommand) {
  for (const SafeAction action : {SafeAction::kFreewheel, SafeAction::kZeroVoltage}) {
    for (const int delay : {0, 1}) {
      BenchSetup setup = servo_setup(delay);
      setup.watchdog_ticks = 5;
      setup.axes[0].on_link_loss = action;
      setup.axes[0].parameters.drive.amplifier.voltage_limit_v = 50.0;
      Bench bench = owned_bench(setup, kOwner);
      step(bench, 9);
      submit_volts(bench, kOwner, 2.0);
      bench.step();
      submit_volts(bench, kOwner, 3.0);
      bench.step();
      for (Tick tick = 11; tick < 15; ++tick) {
        bench.step();
        EXPECT_EQ(state_of(bench), ControlState::kHold);
        EXPECT_EQ(bench.sample(0).u_a_v, 3.0);
        EXPECT_EQ(bench.sample(0).faults, 0u);
        EXPECT_EQ(bench.sample(0).command_age_ticks, static_cast<std::uint64_t>(tick - 10));
      }
      bench.step();  // tick 15
      EXPECT_EQ(state_of(bench), ControlState::kTimeout);
      EXPECT_EQ(bench.sample(0).faults, kCommandTimeout);
      EXPECT_EQ(bench.sample(0).missed_commands, 5u);
      EXPECT_EQ(bench.sample(0).u_a_v == 0.0, action == SafeAction::kZeroVoltage);
      EXPECT_EQ(bench.sample(0).command_tick, -1);
    }
  }
}

// Catches: a latch that commands, other clients or time can undo; a clear that leaves the old voltage in
// force.
TEST(BenchLease, CMD_03_CMD_04_ATimeoutIsLatchedUntilItsOwnerClearsIt) {
  BenchSetup setup = servo_setup();
  setup.watchdog_ticks = 3;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 5.0);
  step(bench, 4);
  ASSERT_EQ(bench.sample(0).faults, kCommandTimeout);
  for (int i = 0; i < 50; ++i)
    EXPECT_EQ(submit_volts(bench, kOwner, 5.0), Refused::kLatched);
  bench.step();
  EXPECT_EQ(bench.sample(0).refused_commands, 50u);
  EXPECT_EQ(submit_clear(bench, kOther), Refused::kNotOwner);
  EXPECT_EQ(submit_clear(bench, 0), Refused::kNotOwner);
  step(bench, 100);
  EXPECT_EQ(bench.sample(0).faults, kCommandTimeout);
  EXPECT_EQ(bench.sample(0).true_i_a_a, 0.0);  // freewheeled
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(state_of(bench), ControlState::kIdle);
  EXPECT_EQ(bench.sample(0).true_i_a_a, 0.0);
  EXPECT_EQ(submit_volts(bench, kOwner, 5.0), Refused::kNot);
  step(bench, 3);
  EXPECT_EQ(state_of(bench), ControlState::kHold);
  EXPECT_EQ(bench.sample(0).faults, 0u);  // the silence counts from the new command
}

// Catches: late ticks that starve the watchdog, or that reset it.
TEST(BenchLease, OS_05_LateTicksNeitherFeedNorStarveTheWatchdog) {
  BenchSetup setup = servo_setup();
  setup.watchdog_ticks = 4;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 5.0);
  step(bench, 3);  // two silent ticks
  for (int i = 0; i < 50; ++i) {
    bench.submit({.tick = bench.tick(), .axis = 0, .owner = 0, .action = LateTick{}});
    bench.step();
    EXPECT_EQ(bench.sample(0).u_a_v, 5.0);
  }
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(bench.sample(0).late_ticks, 50u);
  EXPECT_EQ(bench.sample(0).missed_commands, 2u);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, 0u);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, kCommandTimeout);
}

// Catches: an axis without commands that times out all the same.
TEST(BenchLease, AnOwnerThatNeverCommandedIsIdleNotTimedOut) {
  Bench bench = owned_bench(servo_setup(), kOwner);
  step(bench, 500);
  EXPECT_EQ(state_of(bench), ControlState::kIdle);
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(bench.sample(0).owner, kOwner);
}

// Catches: a second writer, commands without a lease, a lease for owner 0.
TEST(BenchLease, OWN_01_OWN_02_OnlyTheOwnerCommands) {
  Bench bench(servo_setup());
  EXPECT_EQ(submit_volts(bench, kOwner, 1.0), Refused::kNotOwner);
  EXPECT_EQ(submit_volts(bench, 0, 1.0), Refused::kNotOwner);
  EXPECT_EQ(submit_lease(bench, LeaseAction::kAcquire, 0), Refused::kNotOwner);
  EXPECT_EQ(submit_lease(bench, LeaseAction::kAcquire, kOwner), Refused::kNot);
  EXPECT_EQ(submit_lease(bench, LeaseAction::kAcquire, kOwner), Refused::kNot);
  EXPECT_EQ(submit_lease(bench, LeaseAction::kAcquire, kOther), Refused::kOwned);
  for (const LeaseAction action : {LeaseAction::kRenew, LeaseAction::kRelease, LeaseAction::kLost}) {
    EXPECT_EQ(submit_lease(bench, action, kOther), Refused::kNotOwner);
    EXPECT_EQ(submit_lease(bench, action, 0), Refused::kNotOwner);
  }
  EXPECT_EQ(submit_volts(bench, kOther, 1.0), Refused::kNotOwner);
  EXPECT_EQ(bench.owner(0), kOwner);
  EXPECT_EQ(bench.submit({.tick = 0, .axis = 1, .owner = kOwner, .action = LeaseAction::kAcquire}),
            Refused::kUnknownAxis);
  bench.step();
  EXPECT_EQ(bench.sample(0).refused_commands, 0u);
}

/// Counts the inputs that a recorder would get.
class InputCount final : public BenchObserver {
 public:
  void on_input(Tick, const Input&) noexcept override { ++inputs; }
  void on_sample(std::uint32_t, const Sample&) noexcept override {}
  std::uint64_t inputs = 0;
};

// Catches: an input of a session without the lease that is recorded, that changes or counts something in the
// state, or that waits in the schedule.
TEST(BenchLease, OWN_02_OWN_09_InputsWithoutTheLeaseAreNoPartOfTheRun) {
  InputCount alone_count;
  InputCount crowded_count;
  Bench alone(servo_setup(), &alone_count);
  Bench crowded(servo_setup(), &crowded_count);
  const auto crowd = [&crowded] {
    for (const Action& action : std::initializer_list<Action>{
             volts_in_answer_to(crowded.tick(), 9.0), volts_in_answer_to(-7, 9.0), RefusedCommand{true},
             ClearFaults{}, LeaseAction::kRenew, LeaseAction::kRelease, LeaseAction::kLost,
             LoadChange{.load_nm = 1.0, .ramp_ticks = 0}, ParameterWrite{.row = 0, .value = 1.0},
             InjectFault{.row = 0, .value = 1.0}, ShaftBump{1.0}}) {
      for (const Tick later : {0, 5}) {
        EXPECT_EQ(
            crowded.submit({.tick = crowded.tick() + later, .axis = 0, .owner = kOther, .action = action}),
            Refused::kNotOwner);
      }
    }
    EXPECT_EQ(submit_volts(crowded, 0, 9.0), Refused::kNotOwner);
    EXPECT_EQ(submit_lease(crowded, LeaseAction::kAcquire, 0),
              crowded.owner(0) == 0 ? Refused::kNotOwner : Refused::kOwned);
  };
  crowd();
  for (Bench* bench : {&alone, &crowded})
    submit_lease(*bench, LeaseAction::kAcquire, kOwner);
  for (int i = 0; i < 20; ++i) {
    crowd();
    EXPECT_EQ(submit_lease(crowded, LeaseAction::kAcquire, kOther), Refused::kOwned);
    for (Bench* bench : {&alone, &crowded}) {
      submit_volts(*bench, kOwner, 5.0);
      EXPECT_EQ(submit_volts(*bench, kOwner, 5.0), Refused::kStale) << "the owner's own are counted";
      bench->step();
    }
  }
  for (Bench* bench : {&alone, &crowded})
    submit_lease(*bench, LeaseAction::kRelease, kOwner);
  crowd();
  EXPECT_EQ(crowded.sample(0).refused_commands, 20u);
  EXPECT_EQ(crowded_count.inputs, alone_count.inputs);
  EXPECT_EQ(crowded.state_hash(), alone.state_hash());
}

// Acquired at tick 0, renewed at 60, lease of 100: the owner of tick 159, not of 160. Catches: an off-by-one,
// a renewal that is ignored, an expiry without its fault.
TEST(BenchLease, OWN_03_LIMIT_08_ALeaseExpiresExactlyItsTicksAfterItsLastRenewal) {
  for (const bool by_command : {false, true}) {
    BenchSetup setup = servo_setup();
    setup.lease_ticks = 100;
    setup.watchdog_ticks = 1000;
    Bench bench = owned_bench(setup, kOwner);
    submit_volts(bench, kOwner, 1.0);
    step(bench, 60);
    EXPECT_EQ(
        by_command ? submit_volts(bench, kOwner, 1.0) : submit_lease(bench, LeaseAction::kRenew, kOwner),
        Refused::kNot);
    step(bench, 100);  // ticks 60 to 159
    EXPECT_EQ(bench.sample(0).owner, kOwner);
    EXPECT_EQ(bench.sample(0).faults, 0u);
    bench.step();
    EXPECT_EQ(bench.sample(0).owner, 0u);
    EXPECT_EQ(bench.sample(0).faults, kLeaseLost);
    EXPECT_EQ(state_of(bench), ControlState::kTimeout);
    EXPECT_EQ(submit_lease(bench, LeaseAction::kAcquire, kOther), Refused::kNot);
    EXPECT_EQ(submit_volts(bench, kOther, 1.0), Refused::kLatched);
    EXPECT_EQ(submit_clear(bench, kOther), Refused::kNot);
    EXPECT_EQ(submit_volts(bench, kOther, 1.0), Refused::kNot);
    bench.step();
    EXPECT_EQ(state_of(bench), ControlState::kRun);
  }
}

// Catches: an idle owner that leaves a fault behind, a lease that refused commands keep alive.
TEST(BenchLease, AnUnusedLeaseEndsWithoutAFault) {
  BenchSetup setup = servo_setup();
  setup.lease_ticks = 50;
  Bench bench = owned_bench(setup, kOwner);
  for (int i = 0; i < 51; ++i) {
    submit_volts(bench, kOwner, std::numeric_limits<double>::quiet_NaN());
    bench.step();
  }
  EXPECT_EQ(bench.sample(0).owner, 0u);
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(state_of(bench), ControlState::kIdle);
}

// Catches: a release that is a fault, a lost session that is none, a voltage that stays in force after
// either.
TEST(BenchLease, AReleaseIsNoFaultAndALostControllerIsAFault) {
  for (const LeaseAction action : {LeaseAction::kRelease, LeaseAction::kLost}) {
    Bench bench = owned_bench(servo_setup(), kOwner);
    submit_volts(bench, kOwner, 5.0);
    step(bench, 2);
    EXPECT_EQ(submit_lease(bench, action, kOwner), Refused::kNot);
    EXPECT_EQ(bench.owner(0), 0u);
    bench.step();
    EXPECT_EQ(bench.sample(0).faults, action == LeaseAction::kLost ? kLeaseLost : 0u);
    EXPECT_EQ(state_of(bench), action == LeaseAction::kLost ? ControlState::kTimeout : ControlState::kIdle);
    EXPECT_EQ(bench.sample(0).true_i_a_a, 0.0);
    EXPECT_EQ(bench.sample(0).missed_commands, 1u);  // counters outlive the owner
  }
}

// Catches: a run that ends with voltage on the motor, a lease that outlives the run, a tick of safe action
// on a bench without a controller.
TEST(BenchLease, DismissingTheControllersEndsTheRunWithATickOfSafeAction) {
  BenchSetup setup = servo_setup();
  setup.axes[0].on_link_loss = SafeAction::kZeroVoltage;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 12.0);
  bench.step();
  bench.dismiss_controllers();
  EXPECT_EQ(bench.tick(), 2);
  EXPECT_EQ(bench.sample(0).u_a_v, 0.0);
  EXPECT_EQ(bench.sample(0).owner, 0u);
  EXPECT_EQ(bench.sample(0).faults & kLeaseLost, kLeaseLost);
  bench.dismiss_controllers();
  EXPECT_EQ(bench.tick(), 2);
}

// Catches: a load scheduled by one controller that hits the next one, and loads of the configuration that go
// with the first.
TEST(BenchLease, TheScheduleOfAControllerEndsWithItsLease) {
  Bench bench = owned_bench(servo_setup(), kOwner);
  bench.submit({.tick = 5, .axis = 0, .owner = kOwner, .action = LoadChange{0.5, 0}});
  bench.submit({.tick = 8, .axis = 0, .owner = 0, .action = LoadChange{0.25, 0}});
  submit_lease(bench, LeaseAction::kRelease, kOwner);
  step(bench, 7);
  EXPECT_EQ(bench.sample(0).load_nm, 0.0);
  step(bench, 2);
  EXPECT_EQ(bench.sample(0).load_nm, 0.25);
}

// A recording may hold such an input. Catches: a schedule that is shortened by what it is running, and
// a count below zero.
TEST(BenchLease, AScheduledReleaseDropsTheRestOfItsOwnersSchedule) {
  Bench bench = owned_bench(servo_setup(), kOwner);
  const auto schedule = [&bench](Tick tick, Owner owner, const auto& action) {
    bench.submit({.tick = tick, .axis = 0, .owner = owner, .action = action});
  };
  schedule(3, kOwner, LeaseAction::kRelease);
  schedule(3, kOwner, LoadChange{.load_nm = 0.3, .ramp_ticks = 0});
  schedule(4, kOwner, LoadChange{.load_nm = 0.4, .ramp_ticks = 0});
  schedule(5, 0, LoadChange{.load_nm = 0.5, .ramp_ticks = 0});
  step(bench, 5);
  EXPECT_EQ(bench.sample(0).owner, 0u);
  EXPECT_EQ(bench.sample(0).load_nm, 0.0) << "its owner's load goes with it";
  bench.step();
  EXPECT_EQ(bench.sample(0).load_nm, 0.5) << "the load of the configuration stays";
  EXPECT_EQ(bench.sample(0).refused_commands, 0u);
}

// In lockstep time passes only with commands: a controller must be able to watch the motor run down after a
// trip. Catches: gates that a latched axis lets through, and a latched axis whose time stands still.
TEST(BenchLease, ALatchedAxisTakesOnlyCommandsWithTheGatesOff) {
  BenchSetup setup = servo_setup();
  setup.watchdog_ticks = 2;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 12.0);
  step(bench, 3);
  ASSERT_TRUE(bench.is_latched(0));
  EXPECT_EQ(submit_volts(bench, kOwner, 12.0), Refused::kLatched);
  const Command off{.answers = bench.tick(), .phases = {.gates = Gates::kOff, .setpoint = {}}};
  EXPECT_EQ(bench.submit({.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = off}), Refused::kNot);
  EXPECT_TRUE(bench.has_command(0));
  bench.step();
  EXPECT_EQ(state_of(bench), ControlState::kTimeout);
}

}  // namespace
}  // namespace drivebench::bench_lease_test
