#include "protocols/timing/answer_times.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

namespace drivebench::answer_times_test {
namespace {

// Catches: a bin that is too wide or that holds what belongs to its neighbour, a worst value that is only as
// good as its bin.
TEST(TimeHistogram, TellsEveryDurationWithinEightTenthsOfAPercent) {
  for (std::int64_t ns = 1; ns < std::int64_t{1} << TimeHistogram::kMostBits; ns += 1 + ns / 7) {
    TimeHistogram times;
    times.add(ns);
    times.add(3 * ns + 1000);
    const auto exact = static_cast<double>(ns);
    EXPECT_NEAR(times.percentile_ns(0.5), exact, 0.008 * exact);
    EXPECT_EQ(times.smallest_ns(), ns);
    times.each_bin([&](std::int64_t lower, std::int64_t upper, std::uint64_t) { EXPECT_LT(lower, upper); });
  }
  TimeHistogram times;
  times.add(std::int64_t{1} << 50);
  times.add(-5);
  EXPECT_EQ(times.worst_ns(), (std::int64_t{1} << TimeHistogram::kMostBits) - 1);
  EXPECT_EQ(times.smallest_ns(), 0);
  EXPECT_EQ(times.count(), 2u);
}

// Catches: percentiles that are one entry off, jitter about another value than the median.
TEST(TimeHistogram, PercentilesAndJitterAreThoseOfTheEntries) {
  TimeHistogram times;
  times.add(100, 98);
  times.add(90);
  times.add(120);
  EXPECT_EQ(times.percentile_ns(0.0), 90.0);
  EXPECT_EQ(times.percentile_ns(0.01), 90.0);
  EXPECT_EQ(times.percentile_ns(0.02), 100.0);
  EXPECT_EQ(times.percentile_ns(0.99), 100.0);
  EXPECT_EQ(times.percentile_ns(0.995), 120.0);
  EXPECT_EQ(times.percentile_ns(1.0), 120.0);
  EXPECT_DOUBLE_EQ(times.jitter_rms_ns(), std::sqrt((100.0 + 400.0) / 100.0));
  EXPECT_EQ(times.jitter_peak_ns(), 20.0);
  EXPECT_EQ(TimeHistogram{}.percentile_ns(0.5), 0.0);
  EXPECT_EQ(TimeHistogram{}.jitter_rms_ns(), 0.0);
}

// Catches: a sum of two runs that forgets the extremes of one of them.
TEST(TimeHistogram, TheSumOfTwoIsThatOfTheirEntries) {
  std::mt19937_64 engine(1);
  TimeHistogram both;
  TimeHistogram first;
  TimeHistogram second;
  for (int i = 0; i < 1000; ++i) {
    const auto ns = static_cast<std::int64_t>(engine() >> (24 + i % 32));
    both.add(ns);
    (i % 3 == 0 ? first : second).add(ns);
  }
  first.add(second);
  EXPECT_EQ(first.count(), both.count());
  EXPECT_EQ(first.smallest_ns(), both.smallest_ns());
  EXPECT_EQ(first.worst_ns(), both.worst_ns());
  for (const double share : {0.1, 0.5, 0.9, 0.999})
    EXPECT_EQ(first.percentile_ns(share), both.percentile_ns(share));
}

// Catches: an entry that is lost or counted twice on its way from the server to the report.
TEST(AnswerTimes, AreTheSameBehindTheirJson) {
  AnswerTimes times{.late = 3};
  for (const std::int64_t ns : {63'511, 63'512, 70'001, 70'003, 1'234'567})
    times.after_sample.add(ns);
  times.after_tick.add(98'765);
  const AnswerTimes read = answer_times_of(answer_times_json(times));
  EXPECT_EQ(answer_times_json(read), answer_times_json(times));
  EXPECT_EQ(read.after_sample.count(), 5u);
  EXPECT_EQ(read.after_sample.smallest_ns(), 63'511);
  EXPECT_EQ(read.after_sample.worst_ns(), 1'234'567);
  EXPECT_EQ(read.after_tick.smallest_ns(), 98'765);
  EXPECT_EQ(read.after_tick.worst_ns(), 98'765);
  EXPECT_EQ(read.late, 3u);
  EXPECT_EQ(answer_times_of(answer_times_json({})).after_sample.count(), 0u);
  EXPECT_THROW(answer_times_of({{"after_sample", 1}}), nlohmann::json::exception);
}

}  // namespace
}  // namespace drivebench::answer_times_test
