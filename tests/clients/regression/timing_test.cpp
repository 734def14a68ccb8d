#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "clients/regression/timing/log_bins.hpp"
#include "clients/regression/timing/missed_effect.hpp"
#include "clients/regression/timing/timing_report.hpp"
#include "protocols/json.hpp"

namespace drivebench::regression::timing_test {
namespace {

using enum DeviceTiming::Way;

Sample missed(std::uint64_t commands) {
  Sample sample;
  sample.missed_commands = commands;
  return sample;
}

// Catches: a burst that goes on over a tick with a command, or that counts one tick too few.
TEST(MissedTicks, CountTheLongestBurst) {
  MissedTicks ticks;
  for (const std::uint64_t commands : {0U, 1U, 1U, 2U, 3U, 4U, 4U, 5U, 6U, 6U})
    ticks.see(missed(commands));
  EXPECT_EQ(ticks.all, 6u);
  EXPECT_EQ(ticks.longest_burst, 3u);
  MissedTicks other;
  other.see(missed(5));
  ticks.add(other);
  EXPECT_EQ(ticks.all, 11u);
  EXPECT_EQ(ticks.longest_burst, 5u);
}

// Catches: an entry in two bins or in none, a hole between bins.
TEST(LogBins, HoldEveryEntryOnce) {
  TimeHistogram times;
  for (std::int64_t ns = 1; ns < 1'000'000'000; ns += 1 + ns / 50)
    times.add(ns);
  times.add(100'000'000'000);
  const std::vector<LogBin> bins = log_bins(times);
  std::uint64_t all = 0;
  for (std::size_t i = 0; i < bins.size(); ++i) {
    all += bins[i].count;
    EXPECT_EQ(bins[i].from_ns, i > 0 ? bins[i - 1].to_ns : 1);
    EXPECT_LE(bins[i].to_ns, std::max(bins[i].from_ns + 1, bins[i].from_ns + bins[i].from_ns / 8));
  }
  EXPECT_EQ(all, times.count());
  EXPECT_LE(bins.back().from_ns, times.worst_ns());
  EXPECT_GT(bins.back().to_ns, times.worst_ns());
  EXPECT_TRUE(log_bins({}).empty());
}

/// Two runs of a second, of which the second one is later by a constant from 0.4 s on.
Trace ramp(double later) {
  Trace trace;
  trace.columns.push_back({.axis = "servo", .signal = find_signal("speed_rad_s"), .values = {}});
  for (int i = 0; i <= 1000; ++i) {
    const double time_s = i * 1e-3;
    trace.time_s.push_back(time_s);
    trace.columns[0].values.push_back(time_s - (i >= 400 ? later : 0.0) - (i == 777 ? later : 0.0));
  }
  return trace;
}

// Catches: a difference of samples of different ticks, the part before the device took its lease counted, a
// worst place that the drawing leaves out.
TEST(MissedEffect, IsTheDifferenceOfTheTwoRuns) {
  const MissedEffect effect = missed_effect(ramp(0.25), ramp(0.0), 0.2);
  ASSERT_EQ(effect.signals.size(), 1u);
  const SignalEffect& speed = effect.signals[0];
  EXPECT_EQ(speed.axis + "." + speed.signal + " " + speed.unit, "servo.speed_rad_s rad/s");
  EXPECT_DOUBLE_EQ(speed.worst, 0.5);
  EXPECT_DOUBLE_EQ(speed.worst_s, 0.777);
  // 600 samples of 0.25 and one of 0.5 among the 801 from 0.2 s on.
  EXPECT_NEAR(speed.rms, std::sqrt((600 * 0.0625 + 0.25) / 801.0), 1e-12);
  EXPECT_LE(speed.points.size(), 500u);
  EXPECT_DOUBLE_EQ(speed.points.front().time_s, 0.2);
  EXPECT_TRUE(std::ranges::any_of(speed.points, [](const auto& point) { return point.time_s == 0.777; }));
  const std::string drawing = svg_effect(speed);
  EXPECT_NE(drawing.find("servo.speed_rad_s [rad/s]"), std::string::npos);
  EXPECT_NE(drawing.find("at most 0.5 rad/s at 0.777 s"), std::string::npos);
  EXPECT_EQ(missed_effect(ramp(0.1), ramp(0.1), 0.0).signals[0].worst, 0.0);
  EXPECT_NE(missed_effect(ramp(0.1), ramp(0.1), 2.0).problem, "");
}

DeviceTiming timing(DeviceTiming::Way way, std::int64_t period_ns, std::int64_t answer_ns) {
  DeviceTiming t{.way = way, .period_ns = period_ns};
  t.answers.after_sample.add(answer_ns);
  if (way == kRealtime) {
    t.answers.after_tick.add(answer_ns + 10'000);
    t.answers.late = answer_ns + 10'000 >= period_ns ? 1 : 0;
    t.missed.see(missed(t.answers.late));
  }
  return t;
}

// Catches: computing times of a preset and round trips of a program in one percentile, periods mixed in a
// phase, sums without their late answers.
TEST(TimingReport, SumsWhatCanBeCompared) {
  TimingReport report(TimingReport::Format::kJson);
  report.add("a", timing(kInProcess, 100'000, 100));
  report.add("b", timing(kLockstep, 100'000, 40'000));
  report.add("c", timing(kLockstep, 200'000, 50'000));
  report.add("d", timing(kRealtime, 100'000, 60'000));
  report.add("e", timing(kRealtime, 100'000, 95'000));
  report.add("\"f\"", timing(kRealtime, 200'000, 95'000));
  const nlohmann::json json = parse_json(report.text("suite"));
  EXPECT_EQ(json.at("suite"), "suite");
  ASSERT_EQ(json.at("groups").size(), 4u);
  ASSERT_EQ(json.at("cases").size(), 6u);
  EXPECT_EQ(json.at("cases")[5].at("name"), "\"f\"");
  const nlohmann::json& lockstep = json.at("groups")[1];
  EXPECT_EQ(lockstep.at("way"), "lockstep");
  EXPECT_EQ(lockstep.at("cases"), 2);
  EXPECT_EQ(lockstep.at("answers").at("count"), 2);
  EXPECT_EQ(lockstep.at("answers").at("worst_us"), 50.0);
  EXPECT_TRUE(lockstep.at("phase").is_null());
  const nlohmann::json& realtime = json.at("groups")[2];
  EXPECT_EQ(realtime.at("period_us"), 100.0);
  EXPECT_EQ(realtime.at("phase").at("worst_us"), 105.0);
  EXPECT_EQ(realtime.at("late"), 1);
  EXPECT_EQ(realtime.at("missed"), 1);
  EXPECT_EQ(report.summary().substr(0, report.summary().find('\n')),
            "answers in process: 1, p50 0.1 us, p99 0.1 us, worst 0.1 us");
}

// Catches: a page that grows without end, a name that is taken for a tag.
TEST(TimingReport, APageOfManyCasesStaysSmall) {
  TimingReport report(TimingReport::Format::kPage);
  for (int i = 0; i < 2000; ++i)
    report.add("<case>", timing(kRealtime, 100'000, 60'000 + i));
  const std::string page = report.text("suite");
  EXPECT_LT(page.size(), 1'000'000u);
  EXPECT_NE(page.find("&lt;case&gt;"), std::string::npos);
  EXPECT_EQ(page.find("<case>"), std::string::npos);
  std::size_t rows = 0;
  for (std::size_t at = page.find("&lt;case"); at != std::string::npos; at = page.find("&lt;case", at + 1))
    ++rows;
  EXPECT_EQ(rows, 1000u);
  EXPECT_NE(page.find("1000 more cases"), std::string::npos);
  EXPECT_NE(page.find("end of the tick"), std::string::npos);
}

}  // namespace
}  // namespace drivebench::regression::timing_test
