#include "clients/command/identify/data/identify_data.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/identify/identify.hpp"
#include "protocols/mcap/mcap.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::command::identify_data_test {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kToml = R"(
[bench]
name = "b"
substeps = 4
[[axis]]
name = "first"
motor_name = "IM"
[axis.machine]
kind = "induction"
pole_pairs = 2
star = true
stator_resistance_ohm = 9.7
[axis.drive]
kind = "source"
[axis.encoder]
counts_per_revolution = 2048
half_count_offset = true
[[axis]]
name = "second"
[axis.machine]
kind = "pm_dc"
armature_resistance_ohm = 2.0
torque_constant_nm_per_a = 0.07
[axis.drive]
kind = "current_amplifier"
[[axis.set]]
parameter = "machine.torque_constant_nm_per_a"
value = 0.08
at_tick = 10
)";

/// A folder of its own, gone afterwards.
class IdentifyFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("drivebench-identify-" + std::to_string(::getpid()) + "-" +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

  /// Two axes; axis `first` has the current 0.5 A x tick, `second` twice that. Ticks of 250 us, without the
  /// one that is left out.
  std::string recording(const std::string& name, std::uint64_t ticks,
                        std::optional<std::uint64_t> left_out = {}) const {
    std::string file;
    McapWriter writer(
        [&file](std::span<const std::byte> bytes) {
          file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        },
        {.profile = {}, .library = "test"});
    writer.add_attachment("bench.toml", "application/toml", 0, std::as_bytes(std::span(kToml)));
    const std::array axes = {writer.add_channel("/first/sample", 0, "protobuf"),
                             writer.add_channel("/second/sample", 0, "protobuf")};
    for (std::uint64_t tick = 100; tick < 100 + ticks; ++tick) {
      if (left_out == tick) continue;
      if (tick % 100 == 0) writer.flush();
      for (std::size_t axis = 0; axis < axes.size(); ++axis) {
        Sample sample = {.tick = tick};
        sample.i_a_a = 0.5 * static_cast<double>((axis + 1) * tick);
        sample.encoder_count = static_cast<std::int64_t>(tick);
        std::array<std::byte, kMaxSampleBytes> bytes{};
        const std::size_t size = encode_sample(sample, kAllSignals, bytes.data());
        writer.add_message({.channel = axes[axis], .log_time_ns = tick * 250'000},
                           std::span(bytes).first(size));
      }
    }
    writer.finish();
    return write(name, file);
  }

 private:
  fs::path folder_;
};

// Catches: the wrong axis, a period in ticks, a truth or settings that do not come from the file.
TEST_F(IdentifyFiles, ARecordingBringsItsSamplesAndItsConfiguration) {
  const std::string file = recording("r.mcap", 10);
  const MeasuredMotor first = read_recording(file, "");
  EXPECT_EQ(first.data.samples(), 10U);
  EXPECT_NEAR(first.data.period_s, 250e-6, 1e-15);
  EXPECT_EQ(first.data.at("i_a_a")[1], 50.5);
  EXPECT_EQ(first.data.at("encoder_count")[9], 109.0);
  EXPECT_EQ(first.machine, "induction");
  EXPECT_EQ(first.motor, "IM");
  EXPECT_EQ(first.facts.pole_pairs, 2);
  EXPECT_TRUE(first.facts.three_phase);
  EXPECT_EQ(first.facts.counts_per_revolution, 2048.0);
  EXPECT_FALSE(first.facts.half_count);
  EXPECT_EQ(first.facts.voltage_held_ticks, 0.0);  // a source
  EXPECT_EQ(first.bench.at("machine.stator_resistance_ohm"), 9.7);
  const MeasuredMotor second = read_recording(file, "second");
  EXPECT_EQ(second.data.at("i_a_a")[1], 101.0);
  EXPECT_EQ(second.machine, "pm_dc");
  EXPECT_FALSE(second.facts.three_phase);
  EXPECT_EQ(second.facts.voltage_held_ticks, 0.25);  // the last of four steps of a current amplifier
  EXPECT_FALSE(second.bench.contains("machine.torque_constant_nm_per_a")) << "it changes";
}

std::string refusal(const std::string& file, const std::string& axis = {}) {
  try {
    read_recording(file, axis);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "none";
}

// Catches: samples with a hole that pass for equidistant, and files that are no recordings.
TEST_F(IdentifyFiles, AnUnusableRecordingIsRefused) {
  EXPECT_NE(refusal(recording("hole.mcap", 10, 104)).find("tick 105 comes after tick 103"),
            std::string::npos);
  EXPECT_NE(refusal(write("text.mcap", "time,i\n1,2\n")).find("is not a recording"), std::string::npos);
  EXPECT_NE(refusal(write("empty.mcap", "")).find("empty.mcap"), std::string::npos);
  EXPECT_NE(refusal(path("nowhere.mcap")).find("nowhere.mcap"), std::string::npos);
  EXPECT_NE(refusal(recording("r.mcap", 10), "third")
                .find("no samples of axis 'third'; the recording has first, second"),
            std::string::npos);
}

// Catches: a recording cut short by a crash that yields nothing.
TEST_F(IdentifyFiles, ACutRecordingGivesItsSamples) {
  const std::string file = recording("r.mcap", 3000);
  fs::resize_file(file, fs::file_size(file) / 2);
  const MeasuredMotor m = read_recording(file, "");
  EXPECT_GT(m.data.samples(), 100U);
  EXPECT_LT(m.data.samples(), 3000U);
}

// Catches: a configuration of garbage in a recording that ends the command.
TEST(IdentifyData, AnInvalidConfigurationGivesNoFacts) {
  for (const char* text : {"", "[[axis", "axis = 3", "[[axis]]\nname = 5\n", "[axis]\nname = \"a\"\n"}) {
    MeasuredMotor m;
    take_configuration(text, "a", m);
    EXPECT_TRUE(m.bench.empty()) << text;
    EXPECT_TRUE(m.machine.empty()) << text;
  }
}

// Catches: settings of the request that the truth does not know, and a parameter that changes on the way.
TEST(IdentifyData, TheDescriptionAndTheRequestGiveTheFacts) {
  v1::BenchDescription bench;
  bench.set_substeps(5);
  v1::AxisDescription& axis = *bench.add_axes();
  axis.set_machine_kind("bldc");
  axis.set_phases(3);
  axis.set_drive_kind("current_amplifier");
  const auto add = [&](const char* name, double value) {
    v1::ParameterDescription& parameter = *axis.add_parameters();
    parameter.set_name(name);
    parameter.set_value(value);
    return &parameter;
  };
  add("machine.stator_resistance_ohm", 0.7);
  add("machine.torque_constant_nm_per_a", 0.5);
  v1::ParameterDescription* const kind = add("drive.kind", 1.0);
  kind->add_words("voltage_amplifier");
  kind->add_words("current_amplifier");
  v1::RunExperiment request;
  request.set_decimation(4);
  MeasuredMotor m;
  take_description(bench, 0, request, m);
  EXPECT_DOUBLE_EQ(m.facts.voltage_held_ticks, 0.2);
  EXPECT_EQ(m.facts.decimation, 4);
  EXPECT_TRUE(m.facts.three_phase);
  const auto set = [&](const char* name, double value) {
    v1::NamedValue& setting = *request.add_settings();
    setting.set_name(name);
    setting.set_value(value);
  };
  set("machine.stator_resistance_ohm", 0.9);
  set("drive.kind", 0.0);
  request.add_events()->mutable_parameter()->set_name("machine.torque_constant_nm_per_a");
  take_description(bench, 0, request, m);
  EXPECT_EQ(m.bench.at("machine.stator_resistance_ohm"), 0.9);
  EXPECT_FALSE(m.bench.contains("machine.torque_constant_nm_per_a"));
  EXPECT_EQ(m.drive, "voltage_amplifier");
  EXPECT_DOUBLE_EQ(m.facts.voltage_held_ticks, 1.0);
}

// Catches: a column that does not read back as it was, or a header that the reader does not know.
TEST(IdentifyData, CsvReadsBack) {
  const identification::MeasuredData data = {
      .period_s = 1e-4,
      .columns = {{"i_a_a", "A", {0.1, 0.2, 1.0 / 3.0}}, {"encoder_count", "counts", {0, -5, 7}}}};
  const std::string text = csv_of(data);
  EXPECT_TRUE(text.starts_with("time_s,i_a_a [A],encoder_count [counts]\n0.000000000,0.1,0\n")) << text;
  const identification::MeasuredData back = identification::parse_csv(text, "back");
  EXPECT_NEAR(back.period_s, 1e-4, 1e-15);
  EXPECT_EQ(back.at("i_a_a")[2], 1.0 / 3.0);
}

}  // namespace
}  // namespace drivebench::command::identify_data_test
