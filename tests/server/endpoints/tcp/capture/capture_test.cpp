#include "server/endpoints/tcp/capture/capture.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <vector>

namespace drivebench::capture_test {
namespace {

const Signal* signal(std::string_view name) {
  return find_signal(name);
}

/// The places in a row of values at which the event comes.
std::vector<std::size_t> events_in(TriggerEventKind kind, double level, double upper,
                                   std::initializer_list<double> values) {
  EventDetector detector({.kind = kind, .signal = signal("load_nm"), .level = level, .upper = upper});
  std::vector<std::size_t> found;
  std::size_t place = 0;
  for (const double value : values) {
    Sample sample{.tick = place};
    sample.load_nm = value;
    if (detector.see(sample)) found.push_back(place);
    ++place;
  }
  return found;
}

using Places = std::vector<std::size_t>;

// Catches: an edge that fires on the first sample, on a touch from the wrong side, or twice; a level that
// needs a sample before; a band whose ends lie outside, that fires on the first sample or twice, or on a jump
// from one side to the other; a value that lasts.
TEST(EventDetector, EachKindHasItsSampleBefore) {
  using enum TriggerEventKind;
  EXPECT_EQ(events_in(kRising, 1.0, 0.0, {2.0, 0.9, 1.0, 1.1, 0.0, 5.0}), (Places{2, 5}));
  EXPECT_EQ(events_in(kFalling, 1.0, 0.0, {0.0, 1.1, 1.0, 0.9, 2.0, -5.0}), (Places{2, 5}));
  EXPECT_EQ(events_in(kAbove, 1.0, 0.0, {2.0, 1.0, 1.1}), (Places{0, 2}));
  EXPECT_EQ(events_in(kBelow, 1.0, 0.0, {0.0, 1.0, 0.9}), (Places{0, 2}));
  EXPECT_EQ(events_in(kLeaves, -1.0, 2.0, {9.0, 8.0, -9.0, 2.0, 2.1, 2.2, -1.0, -1.1}), (Places{4, 7}));
  EXPECT_EQ(events_in(kEnters, -1.0, 2.0, {0.0, 2.1, 2.0, 1.0, -9.0, 9.0, -1.0}), (Places{2, 6}));
  EXPECT_EQ(events_in(kEquals, 4.0, 0.0, {4.0, 4.0, 1.0, 4.0, 5.0}), (Places{3}));
  EXPECT_EQ(events_in(kRising, 1.0, 0.0, {std::nan(""), 2.0, 0.0, std::nan(""), 2.0}), Places{});
}

// Catches: a bit above 2^53 that a double loses, a bit that lasts, one of another mask, a bit of the first
// sample.
TEST(EventDetector, AnyBitThatAppears) {
  constexpr std::uint64_t kHighest = std::uint64_t{1} << 63;
  EventDetector detector({.kind = TriggerEventKind::kBitsAppear,
                          .signal = signal("injected"),
                          .level = 0.0,
                          .upper = 0.0,
                          .bits = kHighest | 1});
  std::vector<bool> seen;
  for (const std::uint64_t word :
       {kHighest, kHighest, std::uint64_t{2}, kHighest | 2, kHighest | 3, kHighest | 2}) {
    Sample sample;
    sample.injected = word;
    seen.push_back(detector.see(sample));
  }
  EXPECT_EQ(seen, (std::vector<bool>{false, false, false, true, true, false}));
  detector.forget();
  Sample sample;
  sample.injected = 1;
  EXPECT_FALSE(detector.see(sample)) << "nothing is known of the sample before";
}

class CaptureTest : public ::testing::Test {
 protected:
  static CaptureSettings settings(std::uint32_t before, std::uint32_t after, std::uint64_t hold_off = 0) {
    return {
        .axis = 0,
        .event = {.kind = TriggerEventKind::kRising, .signal = signal("load_nm"), .level = 1.0, .upper = 0.0},
        .ticks_before = before,
        .ticks_after = after,
        .hold_off_ticks = hold_off,
        .is_single = false,
        .channels = {{0, signal("load_nm")}, {1, signal("injected")}}};
  }

  /// A tick with this load of axis 0; axis 1 counts in `injected`.
  Capture::Change take(Capture& capture, std::uint64_t tick, double load_nm = 0.0) {
    samples_[0].tick = samples_[1].tick = tick;
    samples_[0].load_nm = load_nm;
    samples_[1].injected = 1000 + tick;
    return capture.take(samples_);
  }
  void take_quiet(Capture& capture, std::uint64_t first, std::uint64_t last) {
    for (std::uint64_t tick = first; tick <= last; ++tick)
      EXPECT_EQ(take(capture, tick), Capture::Change::kNothing) << tick;
  }
  static std::vector<double> ticks_of(const Capture& capture) {
    std::vector<double> ticks;
    for (std::size_t n = 0; n < capture.rows(); ++n)
      ticks.push_back(capture.row(n)[0]);
    return ticks;
  }

  CapturePool pool_;
  std::array<Sample, 2> samples_{};
};

// Catches: a window that is a tick short or at another place, values of another tick or channel, an event of
// one tick that is not seen.
TEST_F(CaptureTest, KeepsTheTicksAroundAnEventOfOneTick) {
  Capture capture(settings(3, 4), 7, pool_);
  take_quiet(capture, 0, 999);
  EXPECT_EQ(take(capture, 1000, 5.0), Capture::Change::kEvent);
  EXPECT_EQ(capture.number(), 8u);
  EXPECT_FALSE(capture.is_complete());
  take_quiet(capture, 1001, 1002);
  EXPECT_EQ(take(capture, 1003), Capture::Change::kComplete);
  EXPECT_EQ(capture.event_tick(), 1000u);
  EXPECT_EQ(ticks_of(capture), (std::vector<double>{997, 998, 999, 1000, 1001, 1002, 1003}));
  const auto row = capture.row(3);
  EXPECT_EQ((std::vector<double>{row.begin(), row.end()}), (std::vector<double>{1000, 5.0, 2000}));
  take_quiet(capture, 1004, 1100);
  EXPECT_EQ(ticks_of(capture).front(), 997.0) << "a complete capture stays as it is";
}

// Catches: an event right after arming that waits for samples before it, a capture of one tick that is never
// complete.
TEST_F(CaptureTest, AnEarlyEventHasFewerTicksBeforeIt) {
  Capture early(settings(100, 2), 0, pool_);
  take_quiet(early, 50, 51);
  EXPECT_EQ(take(early, 52, 2.0), Capture::Change::kEvent);
  EXPECT_EQ(take(early, 53), Capture::Change::kComplete);
  EXPECT_EQ(ticks_of(early), (std::vector<double>{50, 51, 52, 53}));
  Capture shortest(settings(0, 1), 0, pool_);
  take_quiet(shortest, 60, 60);
  EXPECT_EQ(take(shortest, 61, 2.0), Capture::Change::kComplete);
  EXPECT_EQ(ticks_of(shortest), std::vector<double>{61});
}

// Catches: blocks of memory that overlap, a ring that is read in the order of its memory.
TEST_F(CaptureTest, AWindowOfManyBlocksIsInOrder) {
  constexpr std::uint32_t kBefore = 3000;
  constexpr std::uint32_t kAfter = 1777;
  Capture capture(settings(kBefore, kAfter), 0, pool_);
  take_quiet(capture, 0, 9'999);
  EXPECT_EQ(take(capture, 10'000, 2.0), Capture::Change::kEvent);
  for (std::uint64_t tick = 10'001; !capture.is_complete(); ++tick)
    take(capture, tick);
  ASSERT_EQ(capture.rows(), kBefore + kAfter);
  for (std::size_t n = 0; n < capture.rows(); ++n) {
    EXPECT_EQ(capture.row(n)[0], 7000.0 + static_cast<double>(n));
    EXPECT_EQ(capture.row(n)[2], 8000.0 + static_cast<double>(n));
  }
}

// Catches: an event in the hold-off that fires, one after its end that does not, an end that overflows, an
// event while the rows are read that is not told, or counts twice.
TEST_F(CaptureTest, TheHoldOffKeepsEventsAwayAndMissedOnesAreCounted) {
  Capture capture(settings(0, 1, 100), 0, pool_);
  take(capture, 0);
  EXPECT_EQ(take(capture, 10, 2.0), Capture::Change::kComplete);
  // 50 lies in the hold-off; 110 counts and holds off until 210.
  for (const std::uint64_t tick : std::initializer_list<std::uint64_t>{50, 110, 111, 209, 215}) {
    take(capture, tick, 2.0);
    take(capture, tick + 1);
  }
  capture.arm_again();
  EXPECT_EQ(capture.missed_events(), 2u) << "110 and 215";
  EXPECT_EQ(take(capture, 314, 2.0), Capture::Change::kNothing);
  take(capture, 315);
  EXPECT_EQ(take(capture, 316, 2.0), Capture::Change::kComplete);
  EXPECT_EQ(capture.missed_events(), 2u);
  capture.arm_again();
  EXPECT_EQ(capture.missed_events(), 0u);
  Capture once(settings(0, 1, std::numeric_limits<std::uint64_t>::max()), 0, pool_);
  take(once, 400);
  EXPECT_EQ(take(once, 401, 2.0), Capture::Change::kComplete);
  once.arm_again();
  take(once, 402);
  EXPECT_EQ(take(once, 403, 2.0), Capture::Change::kNothing);
}

// Catches: an edge over a gap that is lost, lost ticks without a count, rows older than asked for where
// samples are missing, the value of an older tick in the place of a lost one.
TEST_F(CaptureTest, LostTicksAreCountedAndLeaveNoWrongRows) {
  Capture capture(settings(5, 4), 0, pool_);
  take_quiet(capture, 1, 10);
  EXPECT_EQ(take(capture, 14, 2.0), Capture::Change::kEvent) << "11 to 13 are lost";
  samples_[0].tick = 15;  // the sample of axis 1 is lost
  EXPECT_EQ(capture.take(samples_), Capture::Change::kNothing);
  EXPECT_EQ(take(capture, 20), Capture::Change::kComplete) << "16 to 19 are lost";
  EXPECT_EQ(capture.lost_ticks(), 7u);
  EXPECT_EQ(ticks_of(capture), (std::vector<double>{9, 10, 14, 15}));
  EXPECT_TRUE(std::isnan(capture.row(3)[2]));
  EXPECT_EQ(capture.row(2)[2], 1014.0);
}

// Catches: a tick that came twice and counts twice, a reset of the bench that fires or counts as a loss, or
// that takes a complete capture away.
TEST_F(CaptureTest, AnotherStateOfTheBenchBeginsAnew) {
  Capture capture(settings(5, 3, 1000), 0, pool_);
  take_quiet(capture, 500, 510);
  take_quiet(capture, 510, 510);
  EXPECT_EQ(take(capture, 511, 2.0), Capture::Change::kEvent);
  take_quiet(capture, 512, 512);
  EXPECT_EQ(capture.lost_ticks(), 0u) << "510 came twice";
  capture.begin_anew();
  EXPECT_EQ(take(capture, 0, 2.0), Capture::Change::kNothing) << "no edge from 512 to 0";
  take_quiet(capture, 1, 1);
  EXPECT_EQ(take(capture, 2, 2.0), Capture::Change::kEvent) << "the hold-off was of another run";
  take_quiet(capture, 3, 3);
  EXPECT_EQ(take(capture, 4), Capture::Change::kComplete);
  EXPECT_EQ(capture.lost_ticks(), 0u);
  capture.begin_anew();
  EXPECT_EQ(ticks_of(capture), (std::vector<double>{0, 1, 2, 3, 4}));
}

// Catches: room in the pool that a capture does not take or does not give back.
TEST_F(CaptureTest, ThePoolCountsWhatAllMayTake) {
  {
    const Capture one(settings(3, 4), 0, pool_);
    const Capture two(settings(0, 1), 0, pool_);
    EXPECT_EQ(pool_.captures, 2u);
    EXPECT_EQ(pool_.numbers, 7u * 3 + 1 * 3);
  }
  EXPECT_EQ(pool_.captures, 0u);
  EXPECT_EQ(pool_.numbers, 0u);
}

}  // namespace
}  // namespace drivebench::capture_test
