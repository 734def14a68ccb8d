#include "plant/sensors/encoder.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/plant/encoder_motion.hpp"

namespace drivebench::encoder_test {
namespace {

using namespace encoder_motion;

// SEN-01: the count is never ahead of a rising angle. Catches: rounding to the nearest, truncation towards
// zero.
TEST(Encoder, TheCountIsTheFloorOfTheAngleAndTheOffsetCentresIt) {
  constexpr double kQuantum_rad = kTurn_rad / 2000;
  const Encoder plain({.counts_per_revolution = 2000}, kTick_s);
  const Encoder centred({.counts_per_revolution = 2000, .half_count_offset = true}, kTick_s);
  for (const int k : {0, 1, 7, 1999}) {
    EXPECT_EQ(plain.count_at((k + 0.01) * kQuantum_rad, 0), k);
    EXPECT_EQ(plain.count_at((k + 0.99) * kQuantum_rad, 0), k);
    EXPECT_EQ(plain.count_at((k + 0.99) * kQuantum_rad, -3), k - 6000);
    EXPECT_EQ(centred.count_at((k + 0.49) * kQuantum_rad, 0), k);
    EXPECT_EQ(centred.count_at((k + 0.51) * kQuantum_rad, 1), k + 2001);
  }
  EXPECT_EQ(plain.count_at(-0.01 * kQuantum_rad, 0), -1);
  EXPECT_EQ(centred.count_at(-0.49 * kQuantum_rad, 0), 0);
  EXPECT_EQ(centred.count_at(-0.51 * kQuantum_rad, 0), -1);
}

// Catches: A and B exchanged (the drive would count backwards), a code that is not Gray, a wrong Z.
TEST(Encoder, ALeadsBWhenTheCountRisesAndZMarksMultiplesOfN) {
  const Encoder encoder({.counts_per_revolution = 12}, kTick_s);
  constexpr std::array<std::uint32_t, 4> kRising{0, kLevelA, kLevelA | kLevelB, kLevelB};
  for (std::int64_t count = -30; count <= 30; ++count) {
    const std::uint32_t levels = encoder.levels({.count = count});
    EXPECT_EQ(levels & (kLevelA | kLevelB), kRising[static_cast<std::size_t>((count % 4 + 4) % 4)]);
    EXPECT_EQ((levels & kLevelZ) != 0, count % 12 == 0) << count;
  }
}

// Two edges at one boundary, at times symmetric to the reversal. Catches: a reversal between two nodes that
// is not seen, a flag that says nothing, a period that is not the time between the two.
TEST(Encoder, AReversalWithinATickGivesTwoEdgesAtTheSameBoundary) {
  constexpr int kCounts = 2000;
  constexpr double kQuantum_rad = kTurn_rad / kCounts;
  const Encoder encoder({.counts_per_revolution = kCounts}, kTick_s);
  // Goes 0.2 counts past boundary 11 and returns, in the middle of the third substep.
  constexpr double kTurning_s = 62.5e-6;
  constexpr double kAcceleration = -1e6;
  const double peak_rad = 11.2 * kQuantum_rad;
  const Motion m{peak_rad + 0.5 * kAcceleration * kTurning_s * kTurning_s, -kAcceleration * kTurning_s,
                 kAcceleration};
  ASSERT_EQ(encoder.count_at(m.angle_rad, 0), 10);
  const double half_s = std::sqrt(2.0 * 0.2 * kQuantum_rad / -kAcceleration);
  const std::vector<Edge> edges = edges_of(encoder, m);
  ASSERT_EQ(edges.size(), 2u);
  EXPECT_EQ(edges[0].count, 11);
  EXPECT_EQ(edges[0].direction, 1);
  EXPECT_EQ(edges[1].count, 10);
  EXPECT_EQ(edges[1].direction, -1);
  EXPECT_NEAR(edges[0].time_s, kTurning_s - half_s, kTimeTolerance_s);
  EXPECT_NEAR(edges[1].time_s, kTurning_s + half_s, kTimeTolerance_s);

  const EncoderState state = followed(encoder, m);
  EXPECT_EQ(state.count, 10);
  EXPECT_EQ(state.direction_changed, 1);
  EXPECT_NEAR(state.period_s, 2.0 * half_s, 2.0 * kTimeTolerance_s);
  EXPECT_EQ(encoder.levels(state) & (kReverse | kDirectionChanged | kPeriodValid),
            kReverse | kDirectionChanged | kPeriodValid);
}

// Catches: a direction that is forgotten from tick to tick, a flag that stays.
TEST(Encoder, TheDirectionFlagsFollowTheLastTwoEdges) {
  const Encoder encoder({.counts_per_revolution = 2000}, kTick_s);
  constexpr double kQuantum_rad = kTurn_rad / 2000;
  const double speed_rad_s = kQuantum_rad / kTick_s;  // one count per tick
  EncoderState state = start(encoder, 5.5 * kQuantum_rad);
  const auto flags = [&] { return encoder.levels(state) & (kReverse | kDirectionChanged | kPeriodValid); };
  EXPECT_EQ(flags(), 0u);
  encoder.follow(state, segments_of({5.5 * kQuantum_rad, speed_rad_s, 0.0}), 0, 0);
  EXPECT_EQ(flags(), 0u);
  EXPECT_EQ(state.period_s, 0.0);
  encoder.follow(state, segments_of({6.5 * kQuantum_rad, -speed_rad_s, 0.0}), 1, 0);
  EXPECT_EQ(flags(), kReverse | kDirectionChanged | kPeriodValid);
  encoder.follow(state, segments_of({5.5 * kQuantum_rad, -speed_rad_s, 0.0}), 2, 0);
  EXPECT_EQ(flags(), kReverse | kPeriodValid);
  encoder.follow(state, segments_of({4.5 * kQuantum_rad, 0.0, 0.0}), 3, 0);  // stands
  EXPECT_EQ(flags(), kReverse | kPeriodValid);
  encoder.follow(state, segments_of({4.5 * kQuantum_rad, speed_rad_s, 0.0}), 4, 0);
  EXPECT_EQ(flags(), kDirectionChanged | kPeriodValid);
}

// One count in 3.7 ticks, accelerating. Catches: an age or a period that forgets whole ticks or is measured
// from the wrong end of the tick.
TEST(Encoder, AgeAndPeriodOfTheLastEdgeSpanTicks) {
  const Encoder encoder({.counts_per_revolution = 2000}, kTick_s);
  EXPECT_EQ(encoder.edge_age_s(EncoderState{}, 8), 8 * kTick_s);  // none yet: since tick 0
  constexpr double kQuantum_rad = kTurn_rad / 2000;
  const Motion from_start{0.5 * kQuantum_rad, kQuantum_rad / (3.7 * kTick_s), 0.7};
  Motion m = from_start;
  EncoderState state = start(encoder, m.angle_rad);
  const auto edge_time_s = [&](std::int64_t count) {  // of the motion as a whole
    const double height = static_cast<double>(count) * kQuantum_rad - from_start.angle_rad;
    const double b = from_start.speed_rad_s;
    return 2.0 * height / (b + std::sqrt(b * b + 2.0 * from_start.acceleration_rad_s2 * height));
  };
  for (Tick tick = 0; tick < 400; ++tick) {
    encoder.follow(state, segments_of(m), tick, 0);
    m = m.next();
    if (state.count < 1) continue;
    const double now_s = static_cast<double>(tick + 1) * kTick_s;
    ASSERT_NEAR(encoder.edge_age_s(state, tick + 1), now_s - edge_time_s(state.count), kTimeTolerance_s);
    if (state.count < 2) continue;
    ASSERT_NEAR(state.period_s, edge_time_s(state.count) - edge_time_s(state.count - 1),
                2.0 * kTimeTolerance_s);
  }
  EXPECT_GT(state.count, 100);
}

// Catches: an index that latches on the falling side, one turn off, in one direction only, or the first one
// of several.
TEST(Encoder, TheIndexLatchesWhereZRisesInBothDirectionsAndAcrossTurns) {
  constexpr int kCounts = 2000;
  constexpr double kQuantum_rad = kTurn_rad / kCounts;
  const Encoder encoder({.counts_per_revolution = kCounts}, kTick_s);
  const auto moved = [&](double from_counts, double by_counts, std::int64_t turn) {
    return followed(encoder, {from_counts * kQuantum_rad, by_counts * kQuantum_rad / kTick_s, 0.0}, turn, 77);
  };
  EncoderState s = moved(1999.5, 1.0, 4);  // up into turn 5
  EXPECT_EQ(s.index_count, 10'000);
  EXPECT_EQ(s.index_tick, 77);
  EXPECT_EQ(moved(1998.5, 1.0, 4).index_tick, -1);  // up to 1999 only
  EXPECT_EQ(moved(0.5, 1.0, 4).index_tick, -1);     // leaves the index upwards
  s = moved(1.5, -1.0, 4);                          // down onto it
  EXPECT_EQ(s.index_tick, 77);
  EXPECT_EQ(s.index_count, 8000);
  EXPECT_EQ(moved(0.5, -1.0, 4).index_tick, -1);  // leaves it downwards
  EXPECT_EQ(moved(2.5, -1.0, 4).index_tick, -1);
  s = moved(0.5, -1999.0, 0);  // down from 0 to -1999
  EXPECT_EQ(s.count, -1999);
  EXPECT_EQ(s.index_tick, -1);
  s = moved(0.5, -2000.0, 0);
  EXPECT_EQ(s.index_tick, 77);
  EXPECT_EQ(s.index_count, -2000);
  EXPECT_EQ(moved(10.5, 7000.0, 0).index_count, 6000);  // the last of three
  EXPECT_EQ(moved(10.5, -7000.0, 0).index_count, -6000);
  EXPECT_EQ(moved(10.5, -7000.0, -1).index_count, -8000);
}

// Catches: a newest index that is overwritten by an older one when the shaft turns back within the tick.
TEST(Encoder, AfterAReversalTheIndexIsTheLastOneInTime) {
  constexpr double kQuantum_rad = kTurn_rad / 2000;
  const Encoder encoder({.counts_per_revolution = 2000}, kTick_s);
  // Up past 2000 and 2001, back down onto 2000 and to 1999: Z rises twice, both at count 2000.
  constexpr double kAcceleration = -4e6;
  constexpr double kTurning_s = 50e-6;
  const Motion m{2001.5 * kQuantum_rad + 0.5 * kAcceleration * kTurning_s * kTurning_s,
                 -kAcceleration * kTurning_s, kAcceleration};
  const EncoderState s = followed(encoder, m);
  EXPECT_LT(s.count, 2000);
  EXPECT_EQ(s.index_count, 2000);
  EXPECT_EQ(s.direction, -1);
}

// Random motions, half of them within a few counts of the index, with reversals. Catches: a count that skips
// the edges and the index with them, or that forgets what faults have made of it.
TEST(Encoder, WhoAsksForTheCountAloneGetsTheSameCountAndIndex) {
  constexpr int kCounts = 2000;
  constexpr double kQuantum_rad = kTurn_rad / kCounts;
  const Encoder encoder({.counts_per_revolution = kCounts}, kTick_s);
  std::mt19937_64 random(3);
  const auto between = [&random](double from, double to) {
    return std::uniform_real_distribution(from, to)(random);
  };
  int indices = 0;
  for (int n = 0; n < 20'000; ++n) {
    const double from_counts =
        n % 2 == 0 ? between(0.0, kCounts) : between(-4.0, 4.0) + (n % 4 == 1 ? kCounts : 0);
    const double speed_rad_s = between(-8.0, 8.0) * kQuantum_rad / kTick_s;
    const Motion m{from_counts * kQuantum_rad, speed_rad_s, -speed_rad_s / kTick_s * between(0.0, 4.0)};
    constexpr std::int64_t kTurn = 4;
    EncoderState whole = start(encoder, m.angle_rad, kTurn);
    whole.ahead = 7;
    whole.count -= 7;
    EncoderState count_alone = whole;
    encoder.follow(whole, segments_of(m), n, kTurn, kNoFaults);
    encoder.count(count_alone, segments_of(m), n, kTurn, kNoFaults);
    ASSERT_EQ(count_alone.count, whole.count) << n;
    ASSERT_EQ(count_alone.ahead, whole.ahead) << n;
    ASSERT_EQ(count_alone.index_count, whole.index_count) << n;
    ASSERT_EQ(count_alone.index_tick, whole.index_tick) << n;
    indices += whole.index_tick == n ? 1 : 0;
  }
  EXPECT_GT(indices, 1000);
}

// Catches: a count, turn or edge in 32 bits.
TEST(Encoder, CountsGoOnBeyondThirtyTwoBits) {
  constexpr std::int64_t kTurns = 5'000'000;  // 1e10 counts
  const Encoder encoder({.counts_per_revolution = 2000}, kTick_s);
  for (const std::int64_t turn : {kTurns, -kTurns}) {
    const Motion m{1.0, 300.0, 0.0};
    const EncoderState s = followed(encoder, m, turn);
    EXPECT_EQ(s.count, turn * 2000 + 330);  // (1 + 300 * 125e-6) * 2000/(2 pi) = 330.2
    EXPECT_EQ(edges_of(encoder, m, turn).back().count, s.count);
    EXPECT_EQ(encoder.levels(s) & (kLevelA | kLevelB), kLevelA | kLevelB);
  }
}

// Speed and distance to the boundary are both zero at the start: a division by zero in Newton's method.
// Catches: its return (seen by -fsanitize=float-divide-by-zero, and in the time of the edge).
TEST(Encoder, AShaftThatStartsFromRestOnABoundaryHasItsEdgeAtTheStart) {
  const Encoder encoder({.counts_per_revolution = 2000}, kTick_s);
  const EncoderState s = followed(encoder, {0.0, 0.0, -2e5});
  EXPECT_EQ(s.count, -1);
  EXPECT_EQ(s.last_edge_s, 0.0);
}

// The end of one tick and the start of the next are the same place, but rounding at the wrap may put them on
// two sides of a boundary. Catches: a count that changes without an edge.
TEST(Encoder, ACountThatRoundingChangesBetweenTicksStillHasItsEdge) {
  const Encoder encoder({.counts_per_revolution = 2000}, kTick_s);
  for (const double speed_rad_s : {0.0, 1e-3, -1e-3}) {
    EncoderState state{.count = -1};  // as the last tick left it; this one starts at angle 0 of turn 0
    const auto segments = segments_of({0.0, speed_rad_s, 0.0});
    int edges = 0;
    std::int64_t count = -1;
    encoder.for_each_edge(segments, 0, -1, [&](const Edge& e) {
      ++edges;
      count = e.count;
      EXPECT_EQ(e.time_s, 0.0);
    });
    encoder.follow(state, segments, 3, 0);
    EXPECT_EQ(state.count, speed_rad_s < 0.0 ? -1 : 0);
    EXPECT_EQ(count, state.count);
    EXPECT_EQ(edges, speed_rad_s < 0.0 ? 0 : 1);
    EXPECT_EQ(state.edges_seen, edges);
    EXPECT_EQ(state.index_tick, edges == 1 ? 3 : -1);
  }
}

}  // namespace
}  // namespace drivebench::encoder_test
