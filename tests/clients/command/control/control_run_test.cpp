#include "clients/command/control/control_run.hpp"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>

#include "clients/command/control/control_json.hpp"
#include "clients/identification/data/measured_data.hpp"

namespace drivebench::command::control_run_test {
namespace {

// Catches: a key that one side writes and the other does not read.
TEST(ControlReport, IsReadFromTheJsonThatWasWritten) {
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

// Catches: a peak taken with its sign, over the wrong samples, or a lost tick that is not counted.
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

// Catches: a report that passes off the encoder's angle for the truth, or shows a value that was not
// measured.
TEST(ControlRunSummary, NamesTheSourceOfItsNumbers) {
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

std::string header_of(const ControlRun& run) {
  const std::string csv = to_csv(run);
  return csv.substr(0, csv.find('\n'));
}

// Catches: a dialect of its own, a catalogue's name over something else, a column of zeros for what the link
// does not carry, a row with another number of cells than the header.
TEST(ControlRunCsv, SpeaksTheDialectOfExport) {
  ControlRun run;
  run.counts_per_rad = 2.0;
  run.telemetry_names = {"speed_rad_s"};
  run.telemetry = {0.25};
  run.rows = {{.tick = 7,
               .time_s = 0.5,
               .encoder_count = -3,
               .shaft_rad = 9.0,
               .angle_rad = 1.5,
               .current_a = {1.0, 2.0, 3.0, 4.0},
               .voltage_v = {5.0, 6.0, 7.0, 8.0}}};
  const identification::MeasuredData data = identification::parse_csv(to_csv(run), "run", {.period_s = 1e-3});
  EXPECT_EQ(data.at("encoder_count")[0], -3.0);
  EXPECT_EQ(data.at("angle_rad")[0], 9.0);
  EXPECT_EQ(data.at("moved_rad")[0], 1.5);
  EXPECT_EQ(data.at("controller_speed_rad_s")[0], 0.25);
  EXPECT_EQ(data.at("i_b_a")[0], 2.0);
  EXPECT_EQ(data.at("u_f_v")[0], 8.0);
  EXPECT_EQ(data.at("time_s")[0], 0.5);
  EXPECT_EQ(data.find("i_b_a")->unit, "A");
  EXPECT_NE(header_of(run).find(",command_a_v [V],"), std::string::npos);
  run.quantity = control::Quantity::kCurrent;
  run.knows_angle = run.knows_voltage = false;
  EXPECT_NE(header_of(run).find(",command_a_a [A],"), std::string::npos);
  const identification::MeasuredData less = identification::parse_csv(to_csv(run), "run", {.period_s = 1e-3});
  EXPECT_EQ(less.find("u_a_v"), nullptr);
  EXPECT_EQ(less.find("angle_rad"), nullptr);
}

}  // namespace
}  // namespace drivebench::command::control_run_test
