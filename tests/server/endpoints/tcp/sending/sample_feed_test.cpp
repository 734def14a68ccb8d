#include "server/endpoints/tcp/sending/sample_feed.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace drivebench::sample_feed_test {
namespace {

constexpr std::size_t kAtMost = 32;

void take(SampleFeed& feed, std::uint64_t first, std::uint64_t last) {
  for (std::uint64_t tick = first; tick <= last; ++tick)
    feed.take({.tick = tick});
}

std::vector<std::uint64_t> read_all(const SampleFeed& feed, SampleFeed::Reader& reader) {
  std::vector<std::uint64_t> ticks;
  for (auto piece = feed.read(reader, kAtMost); !piece.empty(); piece = feed.read(reader, kAtMost)) {
    EXPECT_LE(piece.size(), kAtMost);
    for (const Sample& sample : piece)
      ticks.push_back(sample.tick);
  }
  return ticks;
}

std::vector<std::uint64_t> every(std::uint64_t step, std::uint64_t first, std::uint64_t last) {
  std::vector<std::uint64_t> ticks;
  for (std::uint64_t tick = first; tick <= last; tick += step)
    ticks.push_back(tick);
  return ticks;
}

// Catches: a ring that is one sample short, a loss of the newest instead of the oldest, or an uncounted loss.
TEST(SampleFeed, LIMIT_03_256SamplesWaitAndOneMorePushesOutTheOldest) {
  SampleFeed feed(0, 1, 0);
  SampleFeed::Reader at_the_limit = feed.reader();
  SampleFeed::Reader above = feed.reader();
  take(feed, 1, 256);
  EXPECT_EQ(read_all(feed, at_the_limit), every(1, 1, 256));
  EXPECT_EQ(at_the_limit.dropped, 0u);
  take(feed, 257, 257);
  EXPECT_EQ(read_all(feed, above), every(1, 2, 257));
  EXPECT_EQ(above.dropped, 1u);
  EXPECT_EQ(read_all(feed, at_the_limit), every(1, 257, 257)) << "a reader that keeps up loses nothing";
  EXPECT_EQ(at_the_limit.dropped, 0u);
}

// Catches: samples of the wrong ticks, or samples from before the reader came.
TEST(SampleFeed, AReaderGetsEveryNthTickFromItsStartOn) {
  SampleFeed feed(0, 8, 5);
  SampleFeed::Reader first = feed.reader();
  take(feed, 6, 40);
  SampleFeed::Reader second = feed.reader();
  take(feed, 41, 64);
  EXPECT_EQ(read_all(feed, first), every(8, 8, 64));
  EXPECT_EQ(read_all(feed, second), every(8, 48, 64));
  EXPECT_EQ(first.dropped + second.dropped, 0u);
}

// Catches: unseen ticks that are counted wrongly: each sample that was due in them is one loss, for readers
// that wait already.
TEST(SampleFeed, SamplesOfUnseenTicksCountAsLost) {
  SampleFeed feed(0, 4, 0);
  SampleFeed::Reader early = feed.reader();
  take(feed, 1, 4);
  take(feed, 21, 24);  // 8, 12, 16 and 20 are gone
  SampleFeed::Reader late = feed.reader();
  take(feed, 30, 30);  // and 28
  EXPECT_EQ(read_all(feed, early), (std::vector<std::uint64_t>{4, 24}));
  EXPECT_EQ(early.dropped, 5u);
  EXPECT_TRUE(read_all(feed, late).empty());
  EXPECT_EQ(late.dropped, 1u);
}

}  // namespace
}  // namespace drivebench::sample_feed_test
