// A recording in several files.
#include <gtest/gtest.h>

#include <fstream>

#include "protocols/mcap/mcap_series.hpp"
#include "protocols/sample_codec.hpp"
#include "server/host/build_id.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/replay.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::recording_series_test {
namespace {

constexpr Tick kPeriodsPerDay = 86'400;

/// A motor with time constants of minutes, sampled once a second, so that a day is short.
BenchConfig slow_bench() {
  BenchConfig config = parse_config(R"(
[bench]
name = "slow"
mode = "free"
period_us = 1e6
substeps = 1
[[axis]]
name = "slow"
[axis.machine]
kind = "pm_dc"
armature_resistance_ohm = 1.0
armature_inductance_h = 100.0
torque_constant_nm_per_a = 0.01
[axis.mechanics]
inertia_kgm2 = 1.0
viscous_friction_nms = 0.001
[axis.amplifier]
voltage_limit_v = 10.0
over_current_a = 20.0
[axis.encoder]
counts_per_revolution = 4096
)",
                                    "slow.toml", {});
  return config;
}

/// A free run of the bench; returns the number of lost entries.
std::uint64_t run(const std::filesystem::path& file, const BenchConfig& config, Tick ticks,
                  const RecordingOptions& options) {
  Recorder recorder(file, config, {}, options);
  Bench bench(config.setup, &recorder);
  for (Tick tick = 0; tick < ticks; ++tick) {
    recorder.wait_for_room();
    if (tick % 1000 == 7) {
      bench.submit(
          {.tick = tick, .axis = 0, .owner = 0, .action = LoadChange{1e-3 * (tick % 3 == 0 ? 1 : -1), 0}});
    }
    bench.step();
  }
  Verdict verdict{
      .mode = config.mode, .ticks = static_cast<std::uint64_t>(ticks), .state_hash = bench.state_hash()};
  recorder.finish(verdict);
  return recorder.gaps();
}

std::size_t files_in(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator()));
}

std::uint64_t samples_in(std::span<const std::byte> file) {
  McapReader reader(file);
  std::uint64_t samples = 0;
  for (McapMessage message; reader.next(message);)
    samples += reader.channels().at(message.header.channel).topic.ends_with("/sample") ? 1u : 0u;
  EXPECT_FALSE(reader.problem()) << reader.problem()->what;
  return samples;
}

// Catches: a tick that is lost, doubled or torn between two files; files of other sizes than requested; a
// recording that replays in one piece only. A day of plant time, a file each hour.
TEST(RecordingSeries, REC_11_ADayInHourlyFilesLosesNothing) {
  const TestFolder folder;
  EXPECT_EQ(run(folder / "day.mcap", slow_bench(), kPeriodsPerDay, {.file_ticks = 3600}), 0u);
  EXPECT_EQ(files_in((folder / "day.mcap").parent_path()), 25u)
      << "the last one holds the last sample, and the verdict";
  const MappedSeries files((folder / "day.mcap").string());
  ASSERT_EQ(files.segments().size(), 25u);
  for (std::size_t n = 0; n < 24; ++n)
    ASSERT_EQ(samples_in(files.segments()[n]), 3600u) << "file " << n + 1;
  EXPECT_EQ(samples_in(files.segments()[24]), 1u);
  const ReplayReport report = replay(files.segments(), nullptr);
  EXPECT_EQ(report.result, ReplayReport::Result::kEqual) << report.problem;
  EXPECT_EQ(report.samples, static_cast<std::uint64_t>(kPeriodsPerDay) + 1);
  // The sequence numbers go on, so that a gap between two files would show.
  McapSeries series(files.segments());
  std::uint32_t next = 0;
  for (McapMessage message; series.next(message);) {
    if (!series.reader().channels().at(message.header.channel).topic.ends_with("/sample")) continue;
    ASSERT_EQ(message.header.sequence, next++);
  }
}

// Catches: a limit in bytes that is exceeded by more than the last chunk.
TEST(RecordingSeries, REC_11_FilesKeepTheRequestedSize) {
  const TestFolder folder;
  constexpr std::uint64_t kLimit = 300'000;
  const BenchConfig config = servo_bench(2);
  EXPECT_EQ(run(folder / "run.mcap", config, 20'000, {.file_bytes = kLimit}), 0u);
  const MappedSeries files((folder / "run.mcap").string());
  ASSERT_GT(files.segments().size(), 5u);
  const std::uint64_t chunk = 800 * 2 * kMaxSampleBytes;  // 100 ms of it
  for (std::size_t n = 0; n + 1 < files.segments().size(); ++n) {
    EXPECT_GE(files.segments()[n].size(), kLimit);
    EXPECT_LE(files.segments()[n].size(), kLimit + chunk + 20'000) << "with the index at its end";
  }
  EXPECT_EQ(replay(files.segments(), nullptr).result, ReplayReport::Result::kEqual);
}

// Catches: a replay that takes a series with a missing, doubled or foreign file.
TEST(RecordingSeries, REC_11_EveryFileIsNeededInItsPlace) {
  const TestFolder folder;
  run(folder / "run.mcap", slow_bench(), 350, {.file_ticks = 100});
  const MappedSeries files((folder / "run.mcap").string());
  const auto& s = files.segments();
  ASSERT_EQ(s.size(), 4u);
  using Segments = std::vector<std::span<const std::byte>>;
  EXPECT_EQ(replay(s, nullptr).result, ReplayReport::Result::kEqual);
  for (const Segments& wrong : {Segments{s[0], s[1], s[3]}, Segments{s[1], s[2], s[3]},
                                Segments{s[0], s[2], s[1], s[3]}, Segments{s[0], s[1], s[1], s[2], s[3]},
                                Segments{s[3]}, Segments{s[0], s[1].first(s[1].size() - 300), s[2], s[3]}}) {
    const ReplayReport report = replay(wrong, nullptr);
    EXPECT_EQ(report.result, ReplayReport::Result::kUnusable) << report.problem;
  }
  for (const Segments& short_of_its_end :
       {Segments{s[0], s[1], s[2]}, Segments{s[0], s[1], s[2].first(s[2].size() - 300)}}) {
    const ReplayReport report = replay(short_of_its_end, nullptr);
    EXPECT_EQ(report.result, ReplayReport::Result::kEqualWithoutEnd) << report.problem;
    EXPECT_EQ(report.ticks, 299u);
  }
}

// Catches: the files of an older recording taken for the end of the newer one.
TEST(RecordingSeries, REC_07_NoOldFileIsTakenForTheEndOfARecording) {
  const TestFolder folder;
  std::ofstream(folder / "run.2.mcap") << "older";
  EXPECT_THROW(Recorder(folder / "run.mcap", servo_bench()), std::system_error);
  EXPECT_FALSE(std::filesystem::exists(folder / "run.mcap"));
}

// Catches: names that do not sort behind the first, or that leave the folder.
TEST(RecordingSeries, FilesAreNumberedBesideTheFirst) {
  EXPECT_EQ(segment_path("run.mcap", 1), "run.mcap");
  EXPECT_EQ(segment_path("run.mcap", 2), "run.2.mcap");
  EXPECT_EQ(segment_path("a.b/run", 12), "a.b/run.12");
  EXPECT_EQ(segment_path("/x/my.run.mcap", 3), "/x/my.run.3.mcap");
}

}  // namespace
}  // namespace drivebench::recording_series_test
