// Runs of experiments in process.
#include <gtest/gtest.h>

#include "protocols/mcap/mapped_file.hpp"
#include "server/experiments/row_file.hpp"
#include "server/experiments/run.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/replay.hpp"
#include "tests/server/experiments/experiment_requests.hpp"
#include "tests/server/recording/disks.hpp"

namespace drivebench::experiment_run_test {
namespace {

struct Ran {
  RunOutcome outcome;
  std::vector<double> rows;
  ReplayReport replay;
};

Ran run(const ExperimentPlan& plan) {
  const test::Folder folder;
  RunProgress progress;
  const RunFiles files{.recording = folder.path() / "1.mcap", .rows = folder.path() / "1.rows"};
  Ran ran{.outcome = run_experiment(plan, files, "a request", progress, [] {}), .rows = {}, .replay = {}};
  ran.rows.resize(progress.rows.load() * plan.signals.size());
  EXPECT_EQ(std::filesystem::file_size(files.rows), ran.rows.size() * 8);
  FileReader(files.rows).read(0, std::as_writable_bytes(std::span(ran.rows)));
  ran.replay = replay(MappedFile(files.recording.string()).bytes(), nullptr);
  return ran;
}

// Catches: a run that differs from a bench with the same commands, a row too many or too few, a recording
// that does not replay.
TEST(ExperimentRun, EqualsABenchWithTheSameCommandsAndReplays) {
  const ExperimentPlan plan = plan_of(good());
  const Ran ran = run(plan);
  Bench by_hand(plan.config.setup);
  by_hand.submit({.tick = 0, .axis = 0, .owner = 1, .action = LeaseAction::kAcquire});
  ASSERT_EQ(ran.rows.size(), 401u * 2);
  for (Tick tick = 0; tick <= 400; ++tick) {
    const Sample& sample = by_hand.sample(0);
    const auto row = static_cast<std::size_t>(tick);
    ASSERT_EQ(ran.rows[2 * row], sample.i_a_a) << tick;
    ASSERT_EQ(ran.rows[2 * row + 1], sample.speed_rad_s) << tick;
    if (tick == 400) break;
    const Command command{.answers = tick, .phases = command_of(plan, sample, tick)};
    by_hand.submit({.tick = tick, .axis = 0, .owner = 1, .action = command});
    by_hand.step();
  }
  by_hand.dismiss_controllers();
  EXPECT_EQ(ran.outcome.state, v1::EXPERIMENT_STATE_COMPLETED);
  EXPECT_EQ(ran.outcome.verdict.state_hash, by_hand.state_hash());
  EXPECT_EQ(ran.replay.result, ReplayReport::Result::kEqual) << ran.replay.problem;
  EXPECT_NE(ran.rows[2 * 400 + 1], 0.0);
}

// Catches: a limit that is checked in the kept samples only, or a tick too late.
TEST(ExperimentRun, EndsWithTheFirstSampleBeyondALimit) {
  v1::RunExperiment r = good();
  r.mutable_stop()->set_current_a(5.0);
  r.set_decimation(100);
  const Ran stopped = run(plan_of(r));
  EXPECT_EQ(stopped.outcome.state, v1::EXPERIMENT_STATE_STOPPED);
  EXPECT_NE(stopped.outcome.reason.find("current"), std::string::npos) << stopped.outcome.reason;
  r.clear_stop();
  r.set_decimation(1);
  r.set_signals(0, "true_i_a_a");
  r.set_signals(1, "true_i_b_a");
  const Ran whole = run(plan_of(r));
  Tick first = 0;
  while (std::abs(whole.rows[static_cast<std::size_t>(2 * first)]) <= 5.0 &&
         std::abs(whole.rows[static_cast<std::size_t>(2 * first + 1)]) <= 5.0)
    ++first;
  // One tick of safe action ends the run.
  EXPECT_EQ(stopped.outcome.verdict.ticks, static_cast<std::uint64_t>(first + 1));
  EXPECT_NE(stopped.outcome.reason.find("tick " + std::to_string(first) + ":"), std::string::npos);
  EXPECT_EQ(stopped.replay.result, ReplayReport::Result::kEqual) << stopped.replay.problem;
}

// Catches: an initial speed that depends on the inertia, an event a tick late, a setting that is not in
// force.
TEST(ExperimentRun, BeginsWithTheRequestedSpeedAndHasItsEvents) {
  v1::RunExperiment r = good();
  r.mutable_input()->Clear();
  r.mutable_input()->set_kind(v1::INPUT_KIND_NONE);
  r.mutable_initial()->set_speed_rad_s(50.0);
  r.set_signals(0, "load_nm");
  v1::NamedValue& friction = *r.add_settings();
  friction.set_name("mechanics.viscous_friction_nms");
  friction.set_value(0.0);
  v1::ExperimentEvent& load = *r.add_events();
  load.set_at_s(0.02);  // tick 160
  load.set_load_nm(0.1);
  const Ran ran = run(plan_of(r));
  EXPECT_NEAR(ran.rows[2 * 1 + 1], 50.0, 1e-9);  // one rounding of the impulse
  EXPECT_NEAR(ran.rows[2 * 160 + 1], 50.0, 1e-9);
  EXPECT_EQ(ran.rows[2 * 160], 0.0);
  EXPECT_EQ(ran.rows[2 * 161], 0.1);
  EXPECT_LT(ran.rows[2 * 161 + 1], 50.0);
  EXPECT_EQ(ran.replay.result, ReplayReport::Result::kEqual) << ran.replay.problem;
}

// Catches: commands that a latched bench refuses, so that its lease runs out and the counters grow.
TEST(ExperimentRun, ContinuesAfterATrip) {
  v1::RunExperiment r = good();
  r.set_ticks(20'000);  // 2.5 s: longer than the lease
  v1::NamedValue& limit = *r.add_settings();
  limit.set_name("amplifier.over_current_a");
  limit.set_value(4.0);
  v1::NamedValue& trip = *r.add_settings();
  trip.set_name("amplifier.over_current_trip");
  trip.set_value(1.0);
  r.set_signals(0, "refused_commands");
  r.set_signals(1, "faults");
  const Ran ran = run(plan_of(r));
  EXPECT_EQ(ran.outcome.state, v1::EXPERIMENT_STATE_COMPLETED);
  EXPECT_EQ(ran.rows[2 * 20'000], 0.0);
  EXPECT_EQ(static_cast<std::uint64_t>(ran.rows[2 * 20'000 + 1]) & kLeaseLost, 0u);
  EXPECT_NE(static_cast<std::uint64_t>(ran.rows[2 * 20'000 + 1]) & kLatchedFaults, 0u);
}

// Catches: an experiment that takes the last of the disk, goes on without its recording, or does not say what
// it lacks.
TEST(ExperimentRun, REC_03_EndsBeforeTheDiskIsFullAndSaysWhy) {
  const test::Folder folder;
  MemoryDisk disk;
  const RunFiles files{.recording = folder.path() / "1.mcap",
                       .rows = folder.path() / "1.rows",
                       .create_recording = disk.creator()};
  v1::RunExperiment r = good();
  r.set_ticks(100'000);
  const ExperimentPlan plan = plan_of(r);
  RunProgress progress;
  disk.free_bytes = kDiskReserveBytes + (1 << 20);
  const RunOutcome outcome = run_experiment(plan, files, "a request", progress, [] {});
  EXPECT_EQ(outcome.state, v1::EXPERIMENT_STATE_FAILED);
  EXPECT_EQ(outcome.reason, "the recording ended: its disk is full, or has less than 64 MiB left");
  EXPECT_LT(outcome.verdict.ticks, r.ticks());
  EXPECT_GT(disk.free_bytes, kDiskReserveBytes / 2);
  const RunFiles others{.recording = folder.path() / "2.mcap",
                        .rows = folder.path() / "2.rows",
                        .create_recording = files.create_recording};
  EXPECT_THROW(run_experiment(plan, others, "a request", progress, [] {}), std::system_error)
      << "there is no room to begin";
}

}  // namespace
}  // namespace drivebench::experiment_run_test
