// The parts of the command that need no bench. The rest runs against the real server in the wire tests.
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "clients/command/bench/describe.hpp"
#include "clients/command/bench/status.hpp"
#include "clients/command/bench/watch.hpp"
#include "clients/command/can/can_log.hpp"
#include "clients/command/common/errors.hpp"
#include "clients/command/common/process.hpp"
#include "clients/command/common/server_ready.hpp"
#include "clients/command/common/session.hpp"
#include "clients/command/control/control_axis.hpp"
#include "clients/command/control/control_json.hpp"
#include "clients/command/control/control_run.hpp"
#include "clients/command/experiment/experiment.hpp"
#include "clients/command/identify/identify.hpp"
#include "clients/command/recording/export.hpp"
#include "protocols/mcap/mcap.hpp"
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

  /// Two axes, ticks 0 and 1, a command for axis "b" and the verdict of a lockstep run.
  std::string write_lockstep_run(const std::string& name) const {
    std::string file;
    McapWriter writer(
        [&file](std::span<const std::byte> bytes) {
          file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        },
        {.profile = {}, .library = "test"});
    const auto add = [&writer](std::uint16_t channel, std::uint64_t tick, const std::string& message) {
      writer.add_message({.channel = channel, .log_time_ns = tick * 125'000},
                         std::as_bytes(std::span(message)));
    };
    const std::uint16_t inputs = writer.add_channel("/inputs", 0, "protobuf");
    const std::uint16_t verdicts = writer.add_channel("/verdict", 0, "protobuf");
    const std::array axes = {writer.add_channel("/a/sample", 0, "protobuf"),
                             writer.add_channel("/b/sample", 0, "protobuf")};
    for (std::uint64_t tick = 0; tick < 2; ++tick) {
      for (const std::uint16_t axis : axes) {
        v1::Sample sample;
        sample.set_tick(tick);
        sample.set_command_tick(-1);
        sample.set_index_tick(-1);
        sample.set_encoder_count(-5 * static_cast<std::int64_t>(tick));
        sample.set_i_a_a(static_cast<double>(tick));
        sample.set_faults(4 * tick);
        add(axis, tick, sample.SerializeAsString());
      }
      v1::Input input;
      input.set_tick(tick);
      input.set_received_tick(tick);
      input.set_axis(1);
      input.set_owner(0x209);
      if (tick == 0) {
        v1::Command& command = *input.mutable_command();
        command.set_gates(v1::GATES_VOLTAGE);
        command.set_u_a_v(10.0);
        command.set_u_b_v(-0.01);
      } else {
        input.set_late_tick(true);
      }
      add(inputs, tick, input.SerializeAsString());
    }
    v1::Verdict verdict;
    verdict.set_mode(v1::MODE_LOCKSTEP);
    add(verdicts, 2, verdict.SerializeAsString());
    writer.finish();
    std::ofstream(path(name), std::ios::binary) << file;
    return path(name);
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

// Catches a frame of the wrong axis, tick or order, a command that is lost, and a profile that is not heeded.
TEST_F(CommandFiles, ExportWritesTheFramesOfARun) {
  ExportOptions options = {.recording = write_lockstep_run("r.mcap"), .out_file = path("out.log")};
  options.format = "candump";
  options.interface = "vcan0";
  options.classic = true;
  options.node_base = 5;
  options.profile = "current_unit_a=0.01";
  EXPECT_EQ(run_export(options), kExitOk);
  EXPECT_EQ(text_of("out.log"),
            "(0.000000) vcan0 405#0000000000000000\n"
            "(0.000000) vcan0 485#FFFF000000000000\n"
            "(0.000000) vcan0 285#0000000000000000\n"
            "(0.000000) vcan0 185#0000000000000000\n"
            "(0.000000) vcan0 406#0000000000000000\n"
            "(0.000000) vcan0 486#FFFF000000000000\n"
            "(0.000000) vcan0 286#0000000000000000\n"
            "(0.000000) vcan0 186#0000000000000000\n"
            "(0.000000) vcan0 080#0000000001\n"
            "(0.000000) vcan0 206#E803FFFF00000109\n"
            "(0.000125) vcan0 085#0400000001000000\n"
            "(0.000125) vcan0 285#FBFFFFFF00000000\n"
            "(0.000125) vcan0 185#6400000001000000\n"
            "(0.000125) vcan0 086#0400000001000000\n"
            "(0.000125) vcan0 286#FBFFFFFF00000000\n"
            "(0.000125) vcan0 186#6400000001000000\n"
            "(0.000125) vcan0 080#0100000001\n");
  options.axis = "b";
  options.from_tick = 1;
  options.classic = false;
  EXPECT_EQ(run_export(options), kExitOk);
  EXPECT_EQ(text_of("out.log"),
            "(0.000125) vcan0 086##10400000001000000\n"
            "(0.000125) vcan0 186##1010000000000803F00000000FBFFFFFF0000000000000000FFFFFFFF00000000\n"
            "(0.000125) vcan0 080##10100000001\n");
}

// Catches a trace begun with a profile that cannot be.
TEST_F(CommandFiles, ExportRefusesAProfileThatCannotBe) {
  ExportOptions options = {.recording = write_lockstep_run("r.mcap"), .out_file = path("out.log")};
  options.format = "candump";
  options.profile = "current_unit_a=0";
  EXPECT_THROW(run_export(options), link::AddressError);
  EXPECT_FALSE(fs::exists(path("out.log")));
  options.profile = "";
  options.signals = {"i_a_a"};
  EXPECT_THROW(run_export(options), UsageError);
  options.signals = {};
  options.node_base = 127;
  EXPECT_THROW(run_export(options), UsageError);
}

// Catches a link of another kind that is taken for the name of a host.
TEST(Links, OnlyControlGoesOverCanAndModbus) {
  for (const char* address : {"can:socketcan:vcan0", "modbus:127.0.0.1:1"}) {
    EXPECT_THROW(run_status({.link = {.address = address, .token = {}}}), UsageError);
    EXPECT_THROW(run_describe({.link = {.address = address, .token = {}}}), UsageError);
    EXPECT_THROW(run_watch({.link = {.address = address, .token = {}}, .signals = {}}), UsageError);
    EXPECT_THROW(open_axis({.address = address, .token = {}}, "1", "control"), UsageError);
    const ExperimentOptions experiment = {
        .server = {.link = {.address = address, .token = {}}, .owner = "o"}, .id = 1};
    EXPECT_THROW(run_experiment_list(experiment), UsageError);
    EXPECT_THROW(run_experiment_fetch(experiment), UsageError);
    EXPECT_THROW(run_experiment_cancel(experiment), UsageError);
    EXPECT_THROW(run_identify({.server = experiment.server, .link_was_named = true, .motor = "im"}), UsageError);
  }
  EXPECT_THROW(run_can_log({.address = "tcp:127.0.0.1:7300", .out_file = {}}), UsageError);
}

// Catches a latched fault that is overlooked, or one that is not latched taken for it.
TEST(Links, LatchedFaultsAreKnownWithOrWithoutADescription) {
  v1::BenchDescription bench;
  EXPECT_EQ(latched_text(bench, {.state = 1, .faults = 2}), "");
  EXPECT_EQ(latched_text(bench, {.state = 4, .faults = 0x102}), "fault, fault word 0x102");
  v1::FaultDescription& fault = *bench.add_faults();
  fault.set_bit(2);
  fault.set_name("trip");
  fault.set_latched(true);
  EXPECT_EQ(latched_text(bench, {.state = 4, .faults = 3}), "trip");
  EXPECT_EQ(latched_text(bench, {.state = 4, .faults = 1}), "");
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
TEST(ControlRunSummary, TakesPeaksOverAllAndFinalErrorsOverTheLastHundredSamples) {
  ControlRun run;
  run.counts_per_rad = 10.0;
  run.telemetry_names = {"flux_wb", "load_nm"};
  for (std::uint64_t i = 0; i < 200; ++i) {
    ControlRow row = {.tick = 50 + i};
    row.exchange_us = static_cast<double>(i + 1);
    row.measured_error_rad = i == 100 ? -0.5 : i == 99 ? 9.0 : 0.0;
    row.error_rad = i == 10 ? -0.75 : 0.25;
    row.current_a = {1.0, i == 20 ? -5.5 : 1.0, i == 21 ? 5.75 : 0.0, -9.0};
    row.voltage_v = {i == 30 ? -40.0 : 0.0, 0.0, 0.0, 90.0};
    row.setpoint = {0.0, i == 30 ? 41.0 : 0.0, 0.0, 90.0};
    row.saturated = i < 3;
    run.rows.push_back(row);
    run.telemetry.insert(run.telemetry.end(), {0.5, i == 40 ? -2.0 : 1.0});
  }
  run.rows.back().tick += 2;
  run.rows.back().periods = 3;
  const ControlReport report = summary_of(run, 0.001);
  EXPECT_EQ(report.peak_error_rad, 0.75);
  EXPECT_EQ(report.peak_error_counts, 7.5);
  EXPECT_EQ(report.final_error_counts, 5.0);
  EXPECT_EQ(report.final_true_error_counts, 2.5);
  EXPECT_EQ(report.peak_current_a, 5.75);
  EXPECT_EQ(report.peak_field_current_a, 9.0);
  EXPECT_EQ(report.saturated_samples, 3);
  EXPECT_EQ(report.peak_telemetry, (std::map<std::string, double>{{"flux_wb", 0.5}, {"load_nm", 2.0}}));
  EXPECT_EQ(report.peak_voltage_v, 40.0);
  EXPECT_EQ(report.peak_command_voltage_v, 41.0);
  EXPECT_FALSE(report.peak_command_current_a.has_value());
  EXPECT_EQ(report.samples, 200);
  EXPECT_EQ(report.missed_ticks, 2);
  run.missed_at_end = 40;
  EXPECT_EQ(summary_of(run, 0.001).missed_ticks, 42);
  EXPECT_NEAR(report.duration_s, 0.202, 1e-12);
  EXPECT_EQ(report.exchange_p50_us, 100.0);
  EXPECT_EQ(report.exchange_p99_us, 198.0);
  EXPECT_EQ(report.exchange_max_us, 200.0);
}

// Catches a report that passes off the encoder's angle for the truth, or shows what nobody measured.
TEST(ControlRunSummary, SaysWhatItsNumbersRestOn) {
  ControlRun run;
  run.counts_per_rad = 2.0;
  run.rows = {
      {.tick = 1, .error_rad = 1.0, .setpoint = {3.0, 0.0, 0.0, 0.0}, .voltage_v = {9.0, 0.0, 0.0, 0.0}}};
  ControlReport report = summary_of(run, 0.001);
  EXPECT_EQ(report.angle_source + " " + report.speed_source, "truth truth");
  EXPECT_EQ(report.final_true_error_counts, 2.0);
  EXPECT_EQ(report.peak_voltage_v, 9.0);
  run.quantity = control::Quantity::kCurrent;
  run.knows_angle = run.knows_speed = run.knows_voltage = false;
  report = summary_of(run, 0.001);
  EXPECT_EQ(report.angle_source + " " + report.speed_source, "encoder observer");
  EXPECT_EQ(report.peak_error_counts, 2.0);
  EXPECT_FALSE(report.final_true_error_counts.has_value());
  EXPECT_FALSE(report.peak_voltage_v.has_value());
  EXPECT_FALSE(report.peak_command_voltage_v.has_value());
  EXPECT_EQ(report.peak_command_current_a, 3.0);
  const std::string json = control_json(report);
  EXPECT_NE(json.find("\"final_true_error_counts\":null"), std::string::npos) << json;
  ASSERT_TRUE(parse_control(json).has_value());
  EXPECT_FALSE(parse_control(json)->peak_voltage_v.has_value());
  run.counts_per_rad = 0.0;
  EXPECT_FALSE(summary_of(run, 0.001).peak_error_counts.has_value());
}

// Catches a preset that is run on a bench it was not made for.
TEST(Mismatches, NameKindsRateCountsPolePairsAndVoltage) {
  const control::Requirements& needs = control::find_preset("book/8.2.2")->needs;
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
  EXPECT_TRUE(mismatches(bench, 0, needs, 8000.0, kAllSignals).empty());  // a link without kinds
  axis.set_machine_kind("induction");
  axis.set_drive_kind("voltage_amplifier");
  EXPECT_TRUE(mismatches(bench, 0, needs, 8000.0, kAllSignals).empty());
  control::Requirements field = needs;
  field.signal = "i_f_a";
  EXPECT_TRUE(mismatches(bench, 0, field, 8000.0, kAllSignals).empty());
  EXPECT_EQ(mismatches(bench, 0, field, 8000.0, 0).size(), 1U);
  control::Requirements currents = needs;
  currents.quantity = control::Quantity::kCurrent;
  EXPECT_EQ(mismatches(bench, 0, currents, 8000.0, kAllSignals).size(), 1U);
  axis.set_machine_kind("pm_dc");
  axis.set_drive_kind("current_amplifier");
  EXPECT_EQ(mismatches(bench, 0, needs, 8000.0, kAllSignals).size(), 2U);
  bench.set_period_s(250e-6);
  for (v1::ParameterDescription& row : *axis.mutable_parameters())
    row.set_value(row.value() / 2.0);
  EXPECT_EQ(mismatches(bench, 0, needs, 8000.0, kAllSignals).size(), 6U);
}

// Catches a gain that changes the controller but not what it is checked against.
TEST(Mismatches, GainsThatDescribeTheAxisChangeWhatIsNeeded) {
  const control::Preset& preset = *control::find_preset("book/8.2.2");
  const std::vector<control::Gain> gains = {
      {"counts_per_revolution", 4000.0}, {"machine.pole_pairs", 2.0}, {"voltage_limit_v", 60.0}};
  const control::Requirements needs = needs_of(preset, gains);
  EXPECT_EQ(needs.counts_per_revolution, 4000.0);
  EXPECT_EQ(needs.pole_pairs, 2.0);
  EXPECT_EQ(needs.voltage_limit_v, 60.0);
}

}  // namespace
}  // namespace drivebench::command
