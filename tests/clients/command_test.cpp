// The parts of the command that need no bench. The rest runs against the real server in the wire tests.
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "clients/command/commands.hpp"
#include "clients/command/json.hpp"
#include "clients/command/process.hpp"
#include "clients/command/session.hpp"
#include "protocols/mcap.hpp"
#include "protocols/sample_codec.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

/// A folder of its own, gone afterwards.
class CommandFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("drivebench-" + std::to_string(::getpid()) + "-" +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string text_of(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(path(name), std::ios::binary).rdbuf();
    return text.str();
  }

  /// Two axes, ticks 0 to 3, axis "a" with currents that need 17 digits.
  std::string write_recording(const std::string& name, bool whole) const {
    std::string file;
    McapWriter writer(
        [&file](std::span<const std::byte> bytes) {
          file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        },
        {.profile = {}, .library = "test"});
    const std::uint16_t a = writer.add_channel("/a/sample", 0, "protobuf");
    const std::uint16_t b = writer.add_channel("/b/sample", 0, "protobuf");
    const std::uint16_t inputs = writer.add_channel("/inputs", 0, "protobuf");
    for (std::uint64_t tick = 0; tick < 4; ++tick) {
      for (const std::uint16_t channel : {a, b, inputs}) {
        Sample sample = {.tick = tick};
        sample.encoder_count = -5 * static_cast<std::int64_t>(tick);
        sample.i_a_a = 0.1 * static_cast<double>(tick);
        std::array<std::byte, kMaxSampleBytes> bytes{};
        const std::size_t size = encode_sample(sample, kAllSignals, bytes.data());
        writer.add_message({.channel = channel, .log_time_ns = tick * 125'000}, std::span(bytes).first(size));
      }
    }
    writer.flush();
    if (whole) writer.finish();
    std::ofstream(path(name), std::ios::binary) << file;
    return path(name);
  }

 private:
  fs::path folder_;
};

// Catches rows of another axis or tick, a rounded value, a lost sign, a wrong time.
TEST_F(CommandFiles, ExportWritesTheChosenSamplesExactly) {
  ExportOptions options = {.recording = write_recording("r.mcap", true), .out_file = path("out.csv")};
  options.signals = {"encoder_count", "i_a_a"};
  options.axis = "b";
  options.from_tick = 1;
  options.to_tick = 3;
  EXPECT_EQ(run_export(options), kExitOk);
  EXPECT_EQ(text_of("out.csv"),
            "tick,time_s,encoder_count [counts],i_a_a [A]\n"
            "1,0.000125000,-5,0.1\n"
            "2,0.000250000,-10,0.2\n"
            "3,0.000375000,-15,0.30000000000000004\n");
}

// Catches a recording cut short by a crash that yields nothing, or passes for whole.
TEST_F(CommandFiles, ExportOfACutRecordingWritesWhatIsThereAndSaysSo) {
  ExportOptions options = {.recording = write_recording("r.mcap", false), .out_file = path("out.csv")};
  options.signals = {"tick"};
  EXPECT_EQ(run_export(options), kExitCutShort);
  EXPECT_EQ(text_of("out.csv"),
            "tick,time_s,tick [1]\n0,0.000000000,0\n1,0.000125000,1\n2,0.000250000,2\n3,0.000375000,3\n");
}

// Catches an exit code of 0 for a wrong name or file.
TEST_F(CommandFiles, ExportRefusesWhatIsNotThere) {
  const std::string recording = write_recording("r.mcap", true);
  EXPECT_THROW(run_export({.recording = recording, .out_file = path("o"), .axis = "c"}), UsageError);
  EXPECT_THROW(run_export({.recording = recording, .out_file = path("o"), .signals = {"volts"}}), UsageError);
  EXPECT_THROW(run_export({.recording = path("none"), .out_file = path("o")}), UsageError);
  std::ofstream(path("text")) << "tick,time\n";
  EXPECT_THROW(run_export({.recording = path("text"), .out_file = path("o")}), UsageError);
}

// Catches a lost line, a wrong exit code, and a signal that looks like success.
TEST(Process, GivesLinesAndTheExitCode) {
  Process echo({"/bin/sh", "-c", "printf 'one\\ntwo\\n'; exit 7"});
  EXPECT_EQ(echo.read_line(Process::in(10s)), "one");
  EXPECT_EQ(echo.read_line(Process::in(10s)), "two");
  EXPECT_EQ(echo.read_line(Process::in(10s)), std::nullopt);
  EXPECT_EQ(echo.wait(Process::in(10s)), 7);

  Process sleeper({"/bin/sleep", "1000"});
  EXPECT_EQ(sleeper.read_line(Process::in(1ms)), std::nullopt);
  EXPECT_EQ(sleeper.wait(Process::in(1ms)), std::nullopt);
  sleeper.terminate();
  EXPECT_EQ(sleeper.wait(Process::in(10s)), 128 + SIGTERM);

  Process missing({"/nowhere/program"});
  EXPECT_EQ(missing.wait(Process::in(10s)), 127);
}

// Catches a key that one side writes and the other does not read.
TEST(Json, ReadsItsOwnReports) {
  ControlReport report;
  report.preset = "p";
  report.failure = "it \"failed\"";
  report.samples = 1024;
  report.peak_error_counts = 1.48;
  report.exchange_p99_us = 20.5;
  const std::optional<ControlReport> read = parse_control(control_json(report));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->failure, report.failure);
  EXPECT_EQ(read->samples, 1024);
  EXPECT_EQ(read->peak_error_counts, 1.48);
  EXPECT_EQ(read->exchange_p99_us, 20.5);
}

// Catches a line of another kind, or no JSON at all, that passes for the server's.
TEST(Json, ReadsOnlyTheServersOwnLines) {
  const std::string ready =
      R"({"event":"ready","tcp":"127.0.0.1:7300","unix":"","mode":"lockstep","bench":"servo"})";
  ASSERT_TRUE(parse_ready(ready).has_value());
  EXPECT_EQ(parse_ready(ready)->tcp, "127.0.0.1:7300");
  for (const char* line : {"", "ready", "[]", "{}", R"({"event":"ready"})", R"({"event":5,"tcp":""})",
                           R"({"event":"verdict","tcp":"a","mode":"b","bench":"c"})"}) {
    EXPECT_FALSE(parse_ready(line).has_value()) << line;
  }
}

// Catches a peak taken with its sign, over the wrong samples, or a lost tick that is not counted.
TEST(ServoRunSummary, TakesPeaksOverAllAndFinalErrorsOverTheLastHundredSamples) {
  ServoRun run;
  for (std::uint64_t i = 0; i < 200; ++i) {
    ServoRow row = {.tick = 50 + i};
    row.exchange_us = static_cast<double>(i + 1);
    row.measured_error_counts = i == 100 ? -2.0 : i == 99 ? 9.0 : 0.0;
    row.error_counts = i == 10 ? -3.0 : 1.0;
    row.i_b_a = i == 20 ? -5.5 : 1.0;
    row.u_a_v = i == 30 ? -40.0 : 0.0;
    row.command_b_v = i == 30 ? 41.0 : 0.0;
    run.rows.push_back(row);
  }
  run.rows.back().tick += 2;
  run.rows.back().periods = 3;
  const ControlReport report = summary_of(run, 0.001);
  EXPECT_EQ(report.peak_error_counts, 3.0);
  EXPECT_EQ(report.final_error_counts, 2.0);
  EXPECT_EQ(report.final_true_error_counts, 1.0);
  EXPECT_EQ(report.peak_current_a, 5.5);
  EXPECT_EQ(report.peak_voltage_v, 40.0);
  EXPECT_EQ(report.peak_command_voltage_v, 41.0);
  EXPECT_EQ(report.samples, 200);
  EXPECT_EQ(report.missed_ticks, 2);
  EXPECT_NEAR(report.duration_s, 0.202, 1e-12);
  EXPECT_EQ(report.exchange_p50_us, 100.0);
  EXPECT_EQ(report.exchange_p99_us, 198.0);
  EXPECT_EQ(report.exchange_max_us, 200.0);
}

// Catches a preset that is run on a bench it was not made for.
TEST(ServoRunMismatches, NamesRateCountsAndPolePairs) {
  const control::Preset& preset = *control::find_preset("book/8.2.2");
  v1::BenchDescription bench;
  bench.set_period_s(125e-6);
  v1::AxisDescription& axis = *bench.add_axes();
  const auto set = [&axis](const char* name, double value) {
    v1::ParameterDescription& row = *axis.add_parameters();
    row.set_name(name);
    row.set_value(value);
  };
  set("encoder.counts_per_revolution", 2000);
  set("machine.pole_pairs", 3);
  set("amplifier.voltage_limit_v", 80);
  EXPECT_TRUE(mismatches(bench, 0, preset).empty());
  bench.set_period_s(250e-6);
  for (v1::ParameterDescription& row : *axis.mutable_parameters())
    row.set_value(row.value() / 2.0);
  EXPECT_EQ(mismatches(bench, 0, preset).size(), 4U);
}

}  // namespace
}  // namespace drivebench::command
