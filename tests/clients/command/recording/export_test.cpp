#include "clients/command/recording/export.hpp"

#include <bench.pb.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <sstream>

#include "clients/command/common/basics/errors.hpp"
#include "protocols/mcap/mcap.hpp"
#include "protocols/sample_codec.hpp"

namespace drivebench::command::export_test {
namespace {

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

  static void add_verdict(McapWriter& writer, std::optional<std::uint64_t> gaps) {
    if (!gaps) return;
    v1::Verdict verdict;
    verdict.set_gaps(*gaps);
    const std::string message = verdict.SerializeAsString();
    writer.add_message({.channel = writer.add_channel("/verdict", 0, "protobuf")},
                       std::as_bytes(std::span(message)));
  }

  /// Two axes, ticks 0 to 3, axis "a" with currents that need 17 digits. A whole one has a verdict with these
  /// gaps, or none.
  std::string write_recording(const std::string& name, bool whole,
                              std::optional<std::uint64_t> gaps = 0) const {
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
    if (whole) add_verdict(writer, gaps);
    if (whole) writer.finish();
    std::ofstream(path(name), std::ios::binary) << file;
    return path(name);
  }

 private:
  fs::path folder_;
};

// Catches: rows of another axis or tick, a rounded value, a lost sign, a wrong time.
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

// Catches: the recording of a full disk, or one with holes, that passes for the whole run.
TEST_F(CommandFiles, REC_15_ExportOfARecordingWithoutAVerdictOrWithLossesSaysSo) {
  for (const char* format : {"csv", "candump"}) {
    ExportOptions options = {.out_file = path("out.txt"), .format = format};
    options.recording = write_recording("r.mcap", true);
    EXPECT_EQ(run_export(options), kExitOk);
    options.recording = write_recording("r.mcap", true, std::nullopt);
    EXPECT_EQ(run_export(options), kExitCutShort);
    EXPECT_FALSE(text_of("out.txt").empty());
    options.recording = write_recording("r.mcap", true, 7);
    EXPECT_EQ(run_export(options), kExitCutShort);
  }
}

// Catches: CSV in a file whose name promises another format, and a file that is emptied before that is
// noticed.
TEST_F(CommandFiles, REC_15_ExportRefusesASuffixOfAnotherFormat) {
  const std::string recording = write_recording("r.mcap", true);
  const auto refusal = [&](const char* format, const char* name) {
    try {
      run_export({.recording = recording, .out_file = path(name), .format = format});
      return std::string();
    } catch (const UsageError& error) {
      EXPECT_FALSE(fs::exists(path(name)));
      return std::string(error.what());
    }
  };
  for (const char* name : {"e.parquet", "e.csv.gz", "e.log", "e.mcap"})
    EXPECT_NE(refusal("csv", name).find("the name must end with .csv, .txt"), std::string::npos);
  EXPECT_NE(refusal("candump", "e.csv").find("the name must end with .log, .txt"), std::string::npos);
  for (const char* name : {"e.csv", "e.txt", "e"})
    EXPECT_EQ(refusal("csv", name), "");
  EXPECT_EQ(refusal("candump", "e.log"), "");
}

// Catches: a recording cut short by a crash that yields nothing, or passes for whole.
TEST_F(CommandFiles, ExportOfACutRecordingWritesItsSamplesAndReportsTheCut) {
  ExportOptions options = {.recording = write_recording("r.mcap", false), .out_file = path("out.csv")};
  options.signals = {"tick"};
  EXPECT_EQ(run_export(options), kExitCutShort);
  EXPECT_EQ(text_of("out.csv"),
            "tick,time_s,tick [1]\n0,0.000000000,0\n1,0.000125000,1\n2,0.000250000,2\n3,0.000375000,3\n");
}

// Catches: an exit code of 0 for a wrong name or file.
TEST_F(CommandFiles, ExportRefusesAMissingFileAxisOrSignal) {
  const std::string recording = write_recording("r.mcap", true);
  EXPECT_THROW(run_export({.recording = recording, .out_file = path("o"), .axis = "c"}), UsageError);
  EXPECT_THROW(run_export({.recording = recording, .out_file = path("o"), .signals = {"volts"}}), UsageError);
  EXPECT_THROW(run_export({.recording = path("none"), .out_file = path("o")}), UsageError);
  std::ofstream(path("text")) << "tick,time\n";
  EXPECT_THROW(run_export({.recording = path("text"), .out_file = path("o")}), UsageError);
}

// Catches: a frame of the wrong axis, tick or order, a command that is lost, and a profile that is not
// heeded.
TEST_F(CommandFiles, ExportWritesTheFramesOfARun) {
  ExportOptions options = {.recording = write_lockstep_run("r.mcap"), .out_file = path("out.log")};
  options.format = "candump";
  options.interface = "vcan0";
  options.classic = true;
  options.node_base = 5;
  options.profile = "current_unit_a=0.01";
  EXPECT_EQ(run_export(options), kExitOk);
  EXPECT_EQ(text_of("out.log"),
            "(0.000000) vcan0 695#0000000000000000\n"
            "(0.000000) vcan0 6A5#FFFF000000000000\n"
            "(0.000000) vcan0 045#0000000000000000\n"
            "(0.000000) vcan0 065#0000000000000000\n"
            "(0.000000) vcan0 696#0000000000000000\n"
            "(0.000000) vcan0 6A6#FFFF000000000000\n"
            "(0.000000) vcan0 046#0000000000000000\n"
            "(0.000000) vcan0 066#0000000000000000\n"
            "(0.000000) vcan0 008#0000000001\n"
            "(0.000000) vcan0 036#E803FFFF00000109\n"
            "(0.000125) vcan0 015#0400000001000000\n"
            "(0.000125) vcan0 045#FBFFFFFF00000000\n"
            "(0.000125) vcan0 065#6400000001000000\n"
            "(0.000125) vcan0 016#0400000001000000\n"
            "(0.000125) vcan0 046#FBFFFFFF00000000\n"
            "(0.000125) vcan0 066#6400000001000000\n"
            "(0.000125) vcan0 008#0100000001\n");
  options.axis = "b";
  options.from_tick = 1;
  options.classic = false;
  EXPECT_EQ(run_export(options), kExitOk);
  EXPECT_EQ(text_of("out.log"),
            "(0.000125) vcan0 016##10400000001000000\n"
            "(0.000125) vcan0 066##1010000000000803F00000000FBFFFFFF0000000000000000FFFFFFFF00000000\n"
            "(0.000125) vcan0 008##10100000001\n");
  options.profile = "identifiers=canopen";
  EXPECT_EQ(run_export(options), kExitOk);
  EXPECT_NE(text_of("out.log").find(" 186##1"), std::string::npos);
}

// Catches: a trace begun with a profile that cannot be.
TEST_F(CommandFiles, ExportRefusesAnImpossibleProfile) {
  ExportOptions options = {.recording = write_lockstep_run("r.mcap"), .out_file = path("out.log")};
  options.format = "candump";
  options.profile = "current_unit_a=0";
  EXPECT_THROW(run_export(options), link::AddressError);
  EXPECT_FALSE(fs::exists(path("out.log")));
  options.profile = "";
  options.signals = {"i_a_a"};
  EXPECT_THROW(run_export(options), UsageError);
  options.signals = {};
  options.node_base = 15;  // and 16 for the second axis
  EXPECT_THROW(run_export(options), UsageError);
  options.profile = "extended=1";
  EXPECT_EQ(run_export(options), kExitOk);
  options.node_base = 127;
  EXPECT_THROW(run_export(options), UsageError);
}

}  // namespace
}  // namespace drivebench::command::export_test
