#include "server/host/octave_histogram.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <numeric>
#include <thread>

namespace drivebench::octave_histogram_test {
namespace {

// Catches: a bucket whose edge belongs to its neighbour, percentiles off by a bucket, a worst case that is
// rounded.
TEST(OctaveHistogram, PercentilesAreUpperEdgesOfTheirBuckets) {
  OctaveHistogram histogram;
  EXPECT_EQ(histogram.percentile_ns(0.99), 0);
  for (int n = 0; n < 90; ++n)
    histogram.add(124);
  for (int n = 0; n < 9; ++n)
    histogram.add(125);
  histogram.add(1'000'001);
  EXPECT_EQ(histogram.count(), 100u);
  EXPECT_EQ(histogram.sum_ns(), 90u * 124 + 9 * 125 + 1'000'001);
  EXPECT_EQ(histogram.worst_ns(), 1'000'001);
  EXPECT_EQ(histogram.percentile_ns(0.0), 125);
  EXPECT_EQ(histogram.percentile_ns(0.5), 125);
  EXPECT_EQ(histogram.percentile_ns(0.89), 125);
  EXPECT_EQ(histogram.percentile_ns(0.95), 250);
  EXPECT_EQ(histogram.percentile_ns(0.98), 250);
  EXPECT_EQ(histogram.percentile_ns(0.999), 1'000'001) << "never above the worst";
  EXPECT_EQ(histogram.percentile_ns(1.0), 1'000'001);
}

// Catches: a lateness beyond the last bucket that is written past the end.
TEST(OctaveHistogram, EveryLatenessHasABucket) {
  OctaveHistogram histogram;
  for (const std::int64_t lateness : {std::int64_t{0}, std::int64_t{1} << 50, INT64_MAX})
    histogram.add(lateness);
  EXPECT_EQ(histogram.count(), 3u);
  EXPECT_EQ(histogram.worst_ns(), INT64_MAX);
  EXPECT_EQ(histogram.percentile_ns(0.0), 125);
}

// Catches: a view that lacks an entry or counts it twice, a sum of other entries.
TEST(SharedOctaveHistogram, AViewHasWhatTheThreadThatAddsHas) {
  SharedOctaveHistogram histogram;
  for (const std::int64_t time : {-5, 0, 124, 125, 249, 250, 1'000'000})
    histogram.add(time);
  const SharedOctaveHistogram::View view = histogram.view();
  EXPECT_EQ(view.buckets, histogram.own().buckets());
  EXPECT_EQ(view.buckets[0], 3u);
  EXPECT_EQ(view.buckets[1], 2u);
  EXPECT_EQ(view.sum_ns, 124u + 125 + 249 + 250 + 1'000'000) << "a time below zero adds none";
  EXPECT_EQ(view.worst_ns, 1'000'000);
}

// Catches (under the thread sanitizer): counts that another thread reads without an atomic; a count that goes
// back.
TEST(SharedOctaveHistogram, AnotherThreadLooksWhileEntriesCome) {
  constexpr std::uint64_t kEntries = 100'000;
  SharedOctaveHistogram histogram;
  std::thread adds([&histogram] {
    for (std::uint64_t n = 0; n < kEntries; ++n)
      histogram.add(static_cast<std::int64_t>(n));
  });
  for (std::uint64_t seen = 0; seen < kEntries;) {
    const SharedOctaveHistogram::View view = histogram.view();
    const std::uint64_t now = std::accumulate(view.buckets.begin(), view.buckets.end(), std::uint64_t{0});
    ASSERT_GE(now, seen);
    seen = now;
  }
  adds.join();
  EXPECT_EQ(histogram.view().sum_ns, kEntries * (kEntries - 1) / 2);
}

}  // namespace
}  // namespace drivebench::octave_histogram_test
