// Clients without the lease: whatever they ask for, the run and its recording stay the same.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "server/access/seat.hpp"
#include "server/engine/stepped_engine.hpp"
#include "server/host/asio.hpp"
#include "server/pacing/pacer.hpp"
#include "server/recording/replay.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::without_lease_test {
namespace {

const Client kAnna{.transport = "tcp", .peer = "192.0.2.1:5000", .subject = {}};
const Client kBert{.transport = "tcp", .peer = "192.0.2.2:5000", .subject = {}};

/// A recorded run of one axis, whose ticks the test runs one by one in real time too.
class RecordedRun {
 public:
  explicit RecordedRun(RunMode mode) {
    BenchConfig config = servo_bench();
    config.mode = mode;
    auto recorder = std::make_unique<Recorder>(folder_ / "run.mcap", config);
    if (mode == RunMode::kLockstep) {
      lockstep_ = make_lockstep_engine(config, std::move(recorder), io_);
    } else {
      stepped_ = make_stepped_engine(config, std::move(recorder), io_, make_free_pacer());
    }
  }

  Engine& engine() { return lockstep_ ? *lockstep_ : *stepped_.engine; }
  /// Without the commands of all controllers a run in lockstep stands still.
  void tick() {
    if (lockstep_) return engine().advance();
    stepped_.tick();
    io_.restart();
    io_.poll();
  }
  /// The recording, which ends with the hash of the state.
  std::vector<std::byte> end() {
    engine().stop();
    return content_of(folder_ / "run.mcap");
  }
  Refused acquire(Seat& seat, const Client& client) {
    Refused answered = Refused::kBusy;
    seat.ask(
        LeaseAction::kAcquire, seat.number_for(client), [&](Refused refused, Tick) { answered = refused; },
        &client);
    tick();
    return answered;
  }

 private:
  TestFolder folder_;
  asio::io_context io_{1};
  std::unique_ptr<Engine> lockstep_;
  SteppedEngine stepped_;
};

/// All that a client without the lease can send to the bench, more often than a queue has room.
void crowd(Engine& engine) {
  constexpr int kMoreThanTheQueueHolds = 300;
  std::size_t refused = 0;
  const auto count = [&refused](Refused why, Tick) {
    if (lacks_lease(why)) ++refused;
  };
  const auto ask_for = [&](const Action& action) {
    engine.request({.tick = 0, .axis = 0, .owner = 4711, .action = action}, count);
  };
  for (int i = 0; i < kMoreThanTheQueueHolds; ++i) {
    for (const Owner owner : {Owner{0}, Owner{4711}})
      count(engine.command(0, owner, voltage(engine.tick(), 9.0, 9.0)), 0);
    for (const LeaseAction action : {LeaseAction::kRenew, LeaseAction::kRelease, LeaseAction::kLost})
      ask_for(action);
    ask_for(ClearFaults{});
    ask_for(RefusedCommand{true});
  }
  EXPECT_EQ(refused, 7u * kMoreThanTheQueueHolds);
}

/// Anna drives the axis and changes it, and gives it to Bert. With `crowded`, others disturb at every step.
std::vector<std::byte> record(RunMode mode, bool crowded) {
  RecordedRun run(mode);
  Engine& engine = run.engine();
  Seat anna(engine, 0);
  Seat bert(engine, 0);
  Seat rival(engine, 0);
  std::size_t carried_out = 0;
  const auto disturb = [&] {
    if (crowded) crowd(engine);
  };
  disturb();
  EXPECT_EQ(run.acquire(anna, kAnna), Refused::kNot);
  for (Tick i = 0; i < 20; ++i) {
    disturb();
    if (crowded) {
      rival.ask(LeaseAction::kAcquire, rival.number_for(kBert),
                [](Refused why, Tick) { EXPECT_EQ(why, Refused::kOwned); });
    }
    EXPECT_EQ(engine.command(0, anna.owner(), voltage(engine.tick(), 5.0, 1.0)), Refused::kNot);
    engine.request({.tick = 0, .axis = 0, .owner = anna.owner(), .action = LoadChange{0.01, 0}},
                   [&carried_out](Refused why, Tick) {
                     if (why == Refused::kNot) ++carried_out;
                   });
    disturb();
    run.tick();
  }
  EXPECT_EQ(carried_out, 20u);
  anna.give_back();
  EXPECT_EQ(run.acquire(bert, kBert), Refused::kNot);
  disturb();
  run.tick();
  EXPECT_EQ(bert.owner(), 2u) << "the second that was granted a lease";
  return run.end();
}

class WithoutLease : public testing::TestWithParam<RunMode> {};

INSTANTIATE_TEST_SUITE_P(EveryMode, WithoutLease, testing::Values(RunMode::kLockstep, RunMode::kRealtime),
                         [](const auto& mode) { return std::string(name_of(mode.param)); });

// Catches: a request without the lease that is recorded or counted in the state; one that takes the place of
// a request of the controller in the queue; a refused request for a lease that uses up an owner number, which
// the samples of later controllers show.
TEST_P(WithoutLease, OWN_09_TheRecordingOfARunIsTheSameWhateverOthersSend) {
  const std::vector<std::byte> alone = record(GetParam(), false);
  const std::vector<std::byte> crowded = record(GetParam(), true);
  EXPECT_EQ(alone.size(), crowded.size());
  EXPECT_TRUE(alone == crowded);
}

/// Real time: the lease of the controller ends in a tick. With `too_late`, a command of the controller is on
/// its way to that tick, and a load.
std::vector<std::byte> record_end(bool too_late) {
  RecordedRun run(RunMode::kRealtime);
  Engine& engine = run.engine();
  Seat anna(engine, 0);
  EXPECT_EQ(run.acquire(anna, kAnna), Refused::kNot);
  const Owner owner = anna.owner();
  EXPECT_EQ(engine.command(0, owner, voltage(engine.tick(), 5.0, 1.0)), Refused::kNot);
  run.tick();
  anna.lose();
  if (too_late) {
    EXPECT_EQ(engine.command(0, owner, voltage(engine.tick(), 6.0, 1.0)), Refused::kNot)
        << "the newest sample still shows the lease";
    Refused answered = Refused::kNot;
    engine.request({.tick = 0, .axis = 0, .owner = owner, .action = LoadChange{1.0, 0}},
                   [&answered](Refused why, Tick) { answered = why; });
    run.tick();
    EXPECT_EQ(answered, Refused::kNotOwner);
    EXPECT_EQ(engine.newest(0).refused_commands, 0u);
    EXPECT_EQ(engine.command(0, owner, voltage(engine.tick(), 6.0, 1.0)), Refused::kNotOwner);
  } else {
    run.tick();
  }
  return run.end();
}

// The bench judges where the lease stands when it takes an input. Catches: a command or load that the I/O
// thread has passed on and that acts, or is counted, after the end of the lease.
TEST(WithoutLeaseRealtime, OWN_09_WhatComesAfterTheEndOfTheLeaseIsNoPartOfTheRun) {
  EXPECT_TRUE(record_end(true) == record_end(false));
}

// Earlier builds recorded the commands and requests of clients without the lease, and counted the commands in
// the state. Catches: such a recording that replays as different.
TEST(WithoutLeaseReplay, REC_12_OldRecordingsReplay) {
  const TestFolder folder;
  const BenchConfig config = servo_bench();
  Recorder recorder(folder / "run.mcap", config);
  Bench bench(config.setup, &recorder);
  const auto repeat = [&bench](Owner owner, const Action& action) {
    bench.repeat({.tick = bench.tick(), .axis = 0, .owner = owner, .action = action});
  };
  repeat(1, LeaseAction::kAcquire);
  for (Tick tick = 0; tick < 20; ++tick) {
    repeat(2, voltage(tick, 1.0, 1.0));
    repeat(0, RefusedCommand{true});
    repeat(2, LeaseAction::kAcquire);
    repeat(2, ClearFaults{});
    repeat(1, voltage(tick, 20.0, -10.0));
    bench.step();
  }
  EXPECT_EQ(bench.sample(0).refused_commands, 40u);
  recorder.finish({.mode = RunMode::kLockstep, .ticks = 20, .state_hash = bench.state_hash()});
  const ReplayReport report = replay(content_of(folder / "run.mcap"), nullptr);
  EXPECT_EQ(report.result, ReplayReport::Result::kEqual) << report.problem;
  EXPECT_EQ(report.inputs, 101u);
}

}  // namespace
}  // namespace drivebench::without_lease_test
