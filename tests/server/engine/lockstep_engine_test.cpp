// Lockstep: time goes on when the commands of all are there, and the disk has room for the tick.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"
#include "server/recording/replay.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/disks.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::lockstep_engine_test {
namespace {

/// A run whose disk can be made to stand still.
struct SlowDiskRun {
  explicit SlowDiskRun(const BenchConfig& config)
      : engine(make_lockstep_engine(config,
                                    std::make_unique<Recorder>(folder / "run.mcap", config,
                                                               std::initializer_list<RecordingAttachment>{},
                                                               RecordingOptions{.create = disk.creator()}),
                                    io)) {}
  ~SlowDiskRun() { disk.stall(false); }
  /// Commands axis 0 until time stands still, which it does with a command waiting; at that tick.
  Tick stand() {
    disk.stall(true);
    Tick tick = engine->tick();
    for (; engine->tick() == tick; ++tick) {
      if (tick == 4000) disk.wait_until_it_holds_a_writer();
      engine->command(0, kMe, voltage(tick, 1.0, 0.0));
      engine->advance();  // does not wait, or this test would not end
    }
    return engine->tick();
  }
  void go_on() {
    const Tick stands_at = engine->tick();
    disk.stall(false);
    while (engine->tick() == stands_at)
      io.run_one();
  }

  TestFolder folder;
  asio::io_context io{1};
  StallingDisk disk;
  std::unique_ptr<Engine> engine;
};

// Catches: a tick that runs without its command, or does not run with it; on_tick before the sample is there.
TEST(LockstepEngine, ATickRunsWhenItsCommandHasArrived) {
  const auto engine = make_lockstep_engine(servo_bench());
  std::vector<Tick> seen;
  engine->on_tick.add([&] { seen.push_back(engine->tick()); });
  engine->advance();
  EXPECT_EQ(engine->tick(), 0) << "no controller";
  EXPECT_EQ(ask(*engine, lease(LeaseAction::kAcquire)), Refused::kNot);
  engine->advance();
  EXPECT_EQ(engine->tick(), 0) << "no command";
  for (Tick tick = 0; tick < 5; ++tick) {
    EXPECT_EQ(engine->command(0, kMe, voltage(tick, 10.0, 0.0)), Refused::kNot);
    EXPECT_EQ(engine->tick(), tick) << "the tick runs in advance()";
    engine->advance();
    EXPECT_EQ(engine->newest(0).u_a_v, 10.0);
  }
  EXPECT_EQ(seen, (std::vector<Tick>{1, 2, 3, 4, 5}));
  EXPECT_EQ(engine->stop().ticks, 6u) << "the last tick is one of safe action";
}

// Catches: ticks after the end that depend on how soon a process is ended, so that equal runs differ; a
// controller that gets an error for what it may do while time goes on.
TEST(LockstepEngine, AfterItsLastTickTimeStandsStill) {
  asio::io_context io(1);
  const auto engine = make_lockstep_engine(servo_bench(), nullptr, io, 3);
  ask(*engine, lease(LeaseAction::kAcquire));
  for (Tick tick = 0; tick < 3; ++tick) {
    EXPECT_EQ(engine->command(0, kMe, voltage(tick, 10.0, 0.0)), Refused::kNot);
    engine->advance();
  }
  const std::uint64_t hash = engine->state_hash();
  EXPECT_EQ(engine->command(0, kMe, voltage(3, 10.0, 0.0)), Refused::kNot);
  EXPECT_EQ(engine->command(0, kMe, voltage(2, 10.0, 0.0)), Refused::kStale);
  engine->advance();
  EXPECT_EQ(ask(*engine, lease(LeaseAction::kRelease)), Refused::kNot);
  EXPECT_EQ(ask(*engine, lease(LeaseAction::kAcquire, 0, kStranger)), Refused::kBusy);
  EXPECT_FALSE(engine->may_be_acquired(0));
  EXPECT_EQ(engine->tick(), 3);
  EXPECT_EQ(engine->state_hash(), hash);
  EXPECT_EQ(engine->stop().ticks, 4u) << "the last tick is one of safe action";
}

// Catches: a bench that waits for ever for a controller that has left.
TEST(LockstepEngine, ALeaseGivenBackLetsTheOthersGoOn) {
  const auto engine = make_lockstep_engine(servo_bench(2));
  ask(*engine, lease(LeaseAction::kAcquire, 0, kMe));
  ask(*engine, lease(LeaseAction::kAcquire, 1, kStranger));
  engine->command(0, kMe, voltage(0, 1.0, 0.0));
  engine->advance();
  EXPECT_EQ(engine->tick(), 0);
  ask(*engine, lease(LeaseAction::kLost, 1, kStranger));
  EXPECT_EQ(engine->tick(), 1);
}

// Catches: a tick between the end of the old lease and the begin of the new one, in which the axis has no
// owner.
TEST(LockstepEngine, OWN_04_AnAxisIsTakenWithinATick) {
  const auto engine = make_lockstep_engine(servo_bench(2));
  ask(*engine, lease(LeaseAction::kAcquire, 0, kMe));
  ask(*engine, lease(LeaseAction::kAcquire, 1, kStranger));
  engine->command(1, kStranger, voltage(0, 1.0, 0.0));
  engine->advance();
  constexpr Owner kAdministrator = 3;
  engine->take(0, kAdministrator, "a test", [](Refused refused, Tick tick) {
    EXPECT_EQ(refused, Refused::kNot);
    EXPECT_EQ(tick, 0);
  });
  EXPECT_EQ(engine->owner(0), kAdministrator);
  EXPECT_EQ(engine->tick(), 0) << "the new owner has not commanded yet";
}

// Catches: an I/O thread that waits for a disk and serves no session or signal meanwhile; a tick that is
// lost, or runs without its command, when the disk goes on.
TEST(LockstepEngine, REC_06_TimeWaitsForASlowDiskAndTheIoThreadDoesNot) {
  SlowDiskRun run(servo_bench());
  Engine& engine = *run.engine;
  ask(engine, lease(LeaseAction::kAcquire));
  const Tick stands_at = run.stand();
  EXPECT_GT(stands_at, 8000) << "the queue holds more than a second";
  for (int i = 0; i < 5; ++i)
    run.io.run_one();
  EXPECT_EQ(engine.tick(), stands_at);
  run.go_on();
  EXPECT_EQ(engine.tick(), stands_at + 1);
  EXPECT_EQ(engine.stop().gaps, 0u);
}

// Catches: inputs that are taken while there is no room to record them: refused commands, answers to one old
// sample after the other, whatever else clients send without end; a lease that cannot end meanwhile; one that
// is taken and not given.
TEST(LockstepEngine, REC_06_EveryInputTakenWhileTheDiskStandsStillIsRecorded) {
  BenchConfig config = servo_bench(2);
  config.setup.lease_ticks = 1'000'000;  // longer than it takes to fill the queue
  SlowDiskRun run(config);
  Engine& engine = *run.engine;
  // Axis 1 is latched, so that time goes on without its commands: they may answer any sample since.
  ask(engine, lease(LeaseAction::kAcquire, 0, kMe));
  ask(engine, lease(LeaseAction::kAcquire, 1, kStranger));
  engine.command(0, kMe, voltage(0, 1.0, 0.0));
  engine.command(1, kStranger, voltage(0, 1.0, 0.0));
  engine.advance();
  ask(engine, lease(LeaseAction::kLost, 1, kStranger));
  ask(engine, lease(LeaseAction::kAcquire, 1, kStranger));
  const Tick stands_at = run.stand();
  EXPECT_GT(stands_at, 8000);
  const ParameterWrite gain = write_of(servo_axis(), "amplifier.gain", 1.5);
  EXPECT_EQ(engine.try_parameter(0, gain.row, gain.value), "");
  for (int i = 0; i < 2000; ++i) {
    EXPECT_EQ(engine.command(0, kMe, voltage(stands_at, 1.0, 0.0)), Refused::kStale);
    EXPECT_EQ(engine.command(0, kStranger, voltage(stands_at, 1.0, 0.0)), Refused::kNotOwner);
    const Command off{.answers = i, .phases = {}};
    const Refused expected = i == 0 ? Refused::kNot : Refused::kBusy;
    EXPECT_EQ(engine.check(1, kStranger, off), expected);
    EXPECT_EQ(engine.command(1, kStranger, off), expected);
    engine.advance();
    for (const Action& action : std::initializer_list<Action>{
             LoadChange{.load_nm = 0.1, .ramp_ticks = 0}, LeaseAction::kRenew, RefusedCommand{true}, gain}) {
      EXPECT_EQ(ask(engine, {.tick = 0, .axis = 0, .owner = kMe, .action = action}), Refused::kBusy);
    }
    EXPECT_EQ(ask(engine, lease(LeaseAction::kRelease, 0, kStranger)), Refused::kBusy) << "it holds no lease";
    engine.take(0, kStranger, "a test", [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kBusy); });
  }
  ASSERT_EQ(engine.owner(0), kMe);
  EXPECT_EQ(ask(engine, lease(LeaseAction::kRelease, 1, kStranger)), Refused::kNot);
  EXPECT_EQ(engine.owner(1), 0u);
  EXPECT_EQ(engine.tick(), stands_at);
  run.go_on();
  EXPECT_EQ(engine.newest(0).load_nm, 0.0);
  EXPECT_EQ(engine.parameters(0).drive.amplifier.gain, 1.0);
  const Verdict verdict = engine.stop();
  EXPECT_EQ(verdict.gaps, 0u);
  const ReplayReport replayed = replay(content_of(run.folder / "run.mcap"), nullptr);
  EXPECT_EQ(replayed.result, ReplayReport::Result::kEqual) << replayed.problem;
  EXPECT_EQ(replayed.state_hash, verdict.state_hash);
}

// Catches: room that is looked for only where a tick is due, or where a lease is.
TEST(LockstepEngine, REC_06_SessionsWithoutALeaseDoNotFillTheQueueOfAnIdleBench) {
  SlowDiskRun run(servo_bench());
  run.disk.stall(true);
  for (int i = 0; i < 100'000; ++i) {
    ASSERT_EQ(run.engine->command(0, kStranger, voltage(0, 1.0, 0.0)), Refused::kNotOwner);
    ask(*run.engine, {.tick = 0, .axis = 0, .owner = 0, .action = RefusedCommand{}});
  }
  run.disk.stall(false);
  EXPECT_EQ(run.engine->stop().gaps, 0u);
}

// Catches: an owner that is looked up in a sample from before the lease.
TEST(LockstepEngine, TheOwnerIsKnownBeforeTheNextTick) {
  const auto engine = make_lockstep_engine(servo_bench());
  EXPECT_EQ(engine->owner(0), 0u);
  ask(*engine, lease(LeaseAction::kAcquire));
  EXPECT_EQ(engine->owner(0), kMe);
  ask(*engine, lease(LeaseAction::kRelease));
  EXPECT_EQ(engine->owner(0), 0u);
}

// Catches: check() and command() that do not agree, or a check that leaves a trace in the state.
TEST(LockstepEngine, CheckGivesTheAnswerOfCommand) {
  const auto engine = make_lockstep_engine(servo_bench());
  ask(*engine, lease(LeaseAction::kAcquire));
  engine->command(0, kMe, voltage(0, 1.0, 0.0));
  engine->advance();
  const std::uint64_t before = engine->state_hash();
  EXPECT_EQ(engine->check(0, kStranger, voltage(1, 1.0, 0.0)), Refused::kNotOwner);
  EXPECT_EQ(engine->check(0, 0, voltage(1, 1.0, 0.0)), Refused::kNotOwner);
  EXPECT_EQ(engine->check(0, kMe, voltage(1, std::nan(""), 0.0)), Refused::kNotFinite);
  EXPECT_EQ(engine->check(0, kMe, voltage(1, 0.0, HUGE_VAL)), Refused::kNotFinite);
  EXPECT_EQ(engine->check(0, kMe, voltage(0, 1.0, 0.0)), Refused::kStale);
  EXPECT_EQ(engine->check(0, kMe, voltage(2, 1.0, 0.0)), Refused::kStale);
  EXPECT_EQ(engine->check(0, kMe, voltage(1, 1.0, 0.0)), Refused::kNot);
  EXPECT_EQ(engine->state_hash(), before);
  EXPECT_EQ(engine->command(0, kMe, voltage(2, 1.0, 0.0)), Refused::kStale);
  EXPECT_NE(engine->state_hash(), before) << "a refusal is counted";
}

}  // namespace
}  // namespace drivebench::lockstep_engine_test
