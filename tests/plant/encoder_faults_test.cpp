#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <random>
#include <vector>

#include "plant/sensors/encoder.hpp"
#include "tests/plant/encoder_motion.hpp"

namespace drivebench::encoder_faults_test {
namespace {

using namespace encoder_motion;

constexpr int kCounts = 400;
constexpr double kQuantum_rad = kTurn_rad / kCounts;
constexpr EncoderParameters kDisc{.counts_per_revolution = kCounts};

constexpr std::uint32_t kLines = kLevelA | kLevelB;

/// An encoder on a shaft that is moved tick by tick, and the list of its edges beside it.
struct Shaft {
  explicit Shaft(double angle_rad, const EncoderParameters& p = kDisc)
      : encoder(p, kTick_s), at_rad(angle_rad), state(start(encoder, angle_rad)) {}

  /// One tick at constant acceleration; the angle is wrapped as an axis wraps it.
  void move(double speed_rad_s, double acceleration_rad_s2 = 0.0) {
    const Motion m{at_rad, speed_rad_s, acceleration_rad_s2};
    const auto segments = segments_of(m);
    edges.clear();
    encoder.for_each_edge(segments, turn, state, faults, [this](const Edge& e) { edges.push_back(e); });
    before = state;
    encoder.follow(state, segments, tick++, turn, faults);
    at_rad = m.angle_at(kTick_s);
    const double turns = std::floor(at_rad / kTurn_rad);
    at_rad -= turns * kTurn_rad;
    turn += static_cast<std::int64_t>(turns);
  }
  /// The same by counts, in one tick.
  void move_counts(double counts) { move(counts * kQuantum_rad / kTick_s); }

  std::int64_t sound_count() const { return encoder.count_at(at_rad, turn); }
  std::uint32_t lines() const { return encoder.levels(state, faults) & kLines; }
  bool z() const { return (encoder.levels(state, faults) & kLevelZ) != 0; }

  Encoder encoder;
  double at_rad;
  EncoderState state;
  EncoderState before{};
  InjectedFaults faults{};
  std::vector<Edge> edges;
  std::int64_t turn = 0;
  Tick tick = 0;
};

/// Count, edges one by one, and what the state says of the last two, from the list.
void expect_list_and_state_agree(const Shaft& shaft) {
  std::int64_t count = shaft.before.count;
  double last_s = 0.0;
  for (const Edge& e : shaft.edges) {
    ASSERT_EQ(std::abs(e.direction), 1);
    ASSERT_EQ(e.count, count + e.direction);
    ASSERT_GE(e.time_s, last_s - 1e-12);
    ASSERT_LE(e.time_s, kTick_s + 1e-12);
    count = e.count;
    last_s = e.time_s;
  }
  ASSERT_EQ(count, shaft.state.count);
  if (shaft.edges.empty()) {
    ASSERT_EQ(shaft.state.last_edge_tick, shaft.before.last_edge_tick);
    return;
  }
  const std::size_t n = shaft.edges.size();
  ASSERT_EQ(shaft.state.last_edge_tick, shaft.tick - 1);
  ASSERT_EQ(shaft.state.last_edge_s, shaft.edges[n - 1].time_s);
  ASSERT_EQ(shaft.state.direction, shaft.edges[n - 1].direction);
  if (n < 2) return;
  ASSERT_EQ(shaft.state.period_s, shaft.edges[n - 1].time_s - shaft.edges[n - 2].time_s);
  ASSERT_EQ(shaft.state.direction_changed, shaft.edges[n - 1].direction != shaft.edges[n - 2].direction);
}

// Random motion through many turns while every fault comes and goes. Catches: an edge that the count has and
// the list has not, or the reverse; edges out of order; a jump of more than one; last edges of another
// encoder.
TEST(EncoderFaults, TheListOfEdgesAddsUpToTheCountWhateverIsInjected) {
  std::mt19937_64 engine(41);
  const auto draw = [&engine](double size) {
    return std::uniform_real_distribution<double>(-size, size)(engine);
  };
  const auto one_of = [&engine](int choices) {
    return std::uniform_int_distribution<int>(0, choices - 1)(engine);
  };
  std::size_t edges = 0;
  for (const bool swapped : {false, true}) {
    Shaft shaft(1.0, {.counts_per_revolution = kCounts, .half_count_offset = swapped, .swapped = swapped});
    double speed_rad_s = 0.0;
    for (int n = 0; n < 40'000; ++n) {
      if (n % 5 == 0) {
        shaft.faults = {.encoder_swapped = one_of(3) == 0 ? 1.0 : 0.0,
                        .encoder_lost_line = one_of(3) == 0 ? 1.0 + one_of(2) : 0.0,
                        .encoder_lost_pulses = one_of(3) == 0 ? 1.0 + one_of(7) : 0.0,
                        .encoder_index_missing = one_of(3) == 0 ? 1.0 : 0.0,
                        .encoder_eccentricity = one_of(3) == 0 ? 0.1 * std::abs(draw(1.0)) : 0.0,
                        .encoder_extra_pulses = one_of(3) == 0 ? 1.0 + one_of(7) : 0.0};
      }
      const double acceleration = draw(n % 3 == 0 ? 1e7 : 1e5);
      shaft.move(speed_rad_s, acceleration);
      speed_rad_s += acceleration * kTick_s;
      if (std::abs(speed_rad_s) > 1500.0) speed_rad_s = draw(1500.0);
      expect_list_and_state_agree(shaft);
      if (HasFatalFailure()) FAIL() << n;
      edges += shaft.edges.size();
    }
    EXPECT_GT(std::abs(shaft.state.ahead), 100);  // faults have done something
  }
  EXPECT_GT(edges, 100'000u);
}

// A fault that touches neither count nor edges sends them through the code for faults. Catches: a sound
// encoder that is not the one without faults, bit for bit; an edge that is not seen because it comes while
// the shaft creeps, or goes to and fro about a boundary.
TEST(EncoderFaults, TheCodeForFaultsGivesTheBitsOfTheSoundEncoder) {
  std::mt19937_64 engine(42);
  std::uniform_real_distribution<double> draw(-1.0, 1.0);
  Shaft sound(3.0);
  Shaft other(3.0);
  other.faults.encoder_index_missing = 1.0;
  for (int n = 0; n < 20'000; ++n) {
    const double part = n % 2 == 0 ? 1.0 : 0.01;
    const double speed_rad_s = 600.0 * part * draw(engine);
    const double acceleration = 1e7 * part * draw(engine);
    sound.move(speed_rad_s, acceleration);
    other.move(speed_rad_s, acceleration);
    ASSERT_EQ(sound.state.count, other.state.count);
    ASSERT_EQ(sound.state.ahead, 0);
    ASSERT_EQ(other.state.ahead, 0);
    ASSERT_EQ(sound.state.last_edge_tick, other.state.last_edge_tick);
    ASSERT_EQ(sound.state.last_edge_s, other.state.last_edge_s);
    ASSERT_EQ(sound.state.period_s, other.state.period_s);
    ASSERT_EQ(sound.state.direction, other.state.direction);
    ASSERT_EQ(sound.state.edges_seen, other.state.edges_seen);
    ASSERT_EQ(sound.lines(), other.lines());
  }
}

// Catches: an option that exchanges something else, or once more with the fault; edges at other times; Z that
// moves with the count.
TEST(EncoderFaults, SwappedLinesCountBackwardsAtTheSameInstants) {
  Shaft sound(0.0);
  Shaft option(0.0, {.counts_per_revolution = kCounts, .swapped = true});
  Shaft fault(0.0);
  fault.faults.encoder_swapped = 1.0;
  Shaft both(0.0, {.counts_per_revolution = kCounts, .swapped = true});
  both.faults.encoder_swapped = 1.0;
  for (int n = 0; n < 300; ++n) {
    for (Shaft* shaft : {&sound, &option, &fault, &both})
      shaft->move(900.0 - 8.0 * n, -2e4);
    ASSERT_EQ(option.state.count, -sound.state.count);
    ASSERT_EQ(fault.state.count, -sound.state.count);
    ASSERT_EQ(both.state.count, sound.state.count);
    ASSERT_EQ(option.state.last_edge_s, sound.state.last_edge_s);
    ASSERT_EQ(option.state.direction, -sound.state.direction);
    ASSERT_EQ(option.z(), sound.z());
    const bool a = (sound.lines() & kLevelA) != 0;
    const bool b = (sound.lines() & kLevelB) != 0;
    ASSERT_EQ(option.lines(), (b ? kLevelA : 0u) | (a ? kLevelB : 0u));
  }
}

// Catches: a count that starts anew when the fault comes or goes.
TEST(EncoderFaults, TheCountContinuesWhenAFaultBeginsOrEnds) {
  Shaft shaft(0.5 * kQuantum_rad);
  shaft.move_counts(21.0);
  EXPECT_EQ(shaft.state.count, 21);
  shaft.faults.encoder_swapped = 1.0;
  shaft.move_counts(15.0);
  EXPECT_EQ(shaft.state.count, 6);
  shaft.faults = {};
  shaft.move_counts(10.0);
  EXPECT_EQ(shaft.state.count, 16);
  EXPECT_EQ(shaft.sound_count(), 46);
  EXPECT_EQ(shaft.state.ahead, 30);
}

// From each of the four codes, in both directions, the lines exchanged or not. Catches: the wrong line, a
// line that moves, a count that wanders, edges where only the lost line would have changed.
TEST(EncoderFaults, WithALostLineTheCountGoesToAndFro) {
  for (int variant = 0; variant < 32; ++variant) {
    const int phase = variant % 4;
    const bool a_is_lost = (variant & 4) != 0;
    const bool swapped = (variant & 8) != 0;
    const double direction = (variant & 16) != 0 ? -1.0 : 1.0;
    const std::uint32_t lost = a_is_lost ? kLevelA : kLevelB;
    const std::uint32_t kept = a_is_lost ? kLevelB : kLevelA;
    Shaft shaft((200.5 + phase) * kQuantum_rad);
    shaft.faults = {.encoder_swapped = swapped ? 1.0 : 0.0, .encoder_lost_line = a_is_lost ? 1.0 : 2.0};
    shaft.move_counts(0.0);
    EXPECT_LE(std::abs(shaft.state.count - (200 + phase)), swapped ? 2 : 1) << variant;
    std::int64_t low = shaft.state.count;
    std::int64_t high = low;
    std::size_t edges = 0;
    for (int n = 0; n < 40; ++n) {
      shaft.move_counts(direction);
      low = std::min(low, shaft.state.count);
      high = std::max(high, shaft.state.count);
      edges += shaft.edges.size();
      EXPECT_EQ(shaft.lines() & lost, 0u);
      const std::uint32_t sound = shaft.encoder.levels({.count = shaft.sound_count()});
      EXPECT_EQ((shaft.lines() & kept) != 0, (sound & (swapped ? lost : kept)) != 0) << variant;
    }
    EXPECT_EQ(high - low, 1);
    EXPECT_EQ(edges, 20u);  // of 40 changes half were those of the lost line
  }
}

// After an earlier fault the lines may be half a period off. Catches: lines that both change at once, a lost
// line that is left high.
TEST(EncoderFaults, ALostLineChangesTheOthersOneEdgeAtATime) {
  Shaft shaft(0.5 * kQuantum_rad);
  shaft.move_counts(1.0);
  shaft.faults.encoder_swapped = 1.0;
  shaft.move_counts(1.0);  // count 0, the disc at 2
  shaft.faults = {};
  shaft.move_counts(1.0);  // count 1, A is high; the disc at 3, where B would be high
  ASSERT_EQ(shaft.lines(), kLevelA);
  shaft.faults.encoder_lost_line = 1.0;
  shaft.move_counts(0.0);
  ASSERT_EQ(shaft.edges.size(), 2u);  // B rises, A falls
  EXPECT_EQ(shaft.edges[0].count, 2);
  EXPECT_EQ(shaft.edges[1].count, 3);
  EXPECT_EQ(shaft.edges[0].time_s, 0.0);
  EXPECT_EQ(shaft.edges[1].time_s, 0.0);
  EXPECT_EQ(shaft.lines(), kLevelB);
  expect_list_and_state_agree(shaft);
}

// Catches: a loss that depends on the ticks, that is not made good on the way back, or that the index hides.
TEST(EncoderFaults, LostPulsesTakeEveryNthCountAway) {
  for (const int every : {2, 5, 100}) {
    Shaft shaft(0.5 * kQuantum_rad);
    shaft.faults.encoder_lost_pulses = every;
    for (int n = 1; n <= 300; ++n) {
      shaft.move_counts(7.0);
      ASSERT_EQ(shaft.state.count, 7 * n - 7 * n / every);
    }
    EXPECT_EQ(shaft.state.index_count, 2000 - 2000 / every);
    EXPECT_EQ(shaft.state.ahead, 2100 / every);
    for (int n = 299; n >= -300; --n) {
      shaft.move_counts(-7.0);
      const double lost = std::floor(7.0 * n / every);
      ASSERT_EQ(shaft.state.count, static_cast<std::int64_t>(7.0 * n - lost)) << n;
      ASSERT_EQ(shaft.z(), 7 * n % kCounts == 0) << n;
    }
  }
}

// Catches: an extra count that has no edge of its own, that depends on the ticks, or that is kept on the way
// back.
TEST(EncoderFaults, ExtraPulsesDoubleEveryNthCount) {
  for (const int every : {1, 5, 100}) {
    Shaft shaft(0.5 * kQuantum_rad);
    shaft.faults.encoder_extra_pulses = every;
    for (int n = 1; n <= 300; ++n) {
      shaft.move_counts(7.0);
      ASSERT_EQ(shaft.state.count, 7 * n + 7 * n / every);
      ASSERT_EQ(shaft.edges.size(), 7u + static_cast<std::size_t>(7 * n / every - 7 * (n - 1) / every));
      expect_list_and_state_agree(shaft);
    }
    EXPECT_EQ(shaft.state.index_count, 2000 + 2000 / every);
    for (int n = 299; n >= -300; --n) {
      shaft.move_counts(-7.0);
      const double extra = std::floor(7.0 * n / every);
      ASSERT_EQ(shaft.state.count, static_cast<std::int64_t>(7.0 * n + extra)) << n;
      ASSERT_EQ(shaft.z(), 7 * n % kCounts == 0) << n;
    }
  }
}

// 1e12 counts in a tick. Catches: a search through them for edges that are not there, a count that moves.
TEST(EncoderFaults, AnEncoderThatLosesEveryCountStandsStill) {
  Shaft shaft(0.5 * kQuantum_rad);
  shaft.faults.encoder_lost_pulses = 1.0;
  const auto segments = segments_of({shaft.at_rad, 1e12 * kQuantum_rad / kTick_s, 0.0});
  shaft.encoder.follow(shaft.state, segments, 0, 0, shaft.faults);
  EXPECT_EQ(shaft.state.count, 0);
  EXPECT_NEAR(static_cast<double>(shaft.state.ahead), 1e12, 1.0);
  EXPECT_EQ(shaft.state.edges_seen, 0);
}

// Catches: an index that is latched all the same, counts that are lost with it.
TEST(EncoderFaults, WithoutTheIndexZStaysLowAndTheCountGoesOn) {
  Shaft shaft(398.5 * kQuantum_rad);
  shaft.faults.encoder_index_missing = 1.0;
  shaft.move_counts(2.0);
  EXPECT_EQ(shaft.state.count, 400);
  EXPECT_FALSE(shaft.z());
  EXPECT_EQ(shaft.state.index_tick, -1);
  shaft.faults = {};
  EXPECT_TRUE(shaft.z());
  shaft.move_counts(-1.0);
  shaft.move_counts(1.0);
  EXPECT_EQ(shaft.state.index_tick, 2);
  EXPECT_EQ(shaft.state.index_count, 400);
}

// The count is that of theta + e sin(theta) at every tick, as closely as the cubic between nodes goes: the
// error is (turn per substep)^4/384 e = 1e-12 of a turn. Catches: a wrong sign or phase, an angle per
// electrical turn, an error that stays when the fault is gone.
TEST(EncoderFaults, EccentricityAddsASineOncePerTurn) {
  constexpr double kEccentricity_rad = 0.08;  // 5.1 counts
  Shaft shaft(0.3);
  for (int n = 0; n < 2000; ++n) {
    shaft.faults.encoder_eccentricity = n >= 100 && n < 1900 ? kEccentricity_rad : 0.0;
    shaft.move(47.0);
    const double seen_rad = shaft.at_rad + shaft.faults.encoder_eccentricity * std::sin(shaft.at_rad);
    const double position = seen_rad / kQuantum_rad;
    if (std::abs(position - std::round(position)) < 1e-6) continue;  // on a boundary
    ASSERT_EQ(shaft.state.count, static_cast<std::int64_t>(std::floor(position)) + shaft.turn * kCounts) << n;
    expect_list_and_state_agree(shaft);
  }
  EXPECT_EQ(shaft.state.ahead, 0);
}

// At theta = 90 degrees 0.08 rad are 5.09 counts. Catches: a jump without edges, edges in the middle of the
// tick, a jump that falls on the first segment's motion.
TEST(EncoderFaults, EccentricityThatComesAndGoesJumpsAtTheStartOfTheTick) {
  Shaft shaft(100.5 * kQuantum_rad);
  shaft.faults.encoder_eccentricity = 0.08;
  shaft.move_counts(-0.2);
  ASSERT_EQ(shaft.edges.size(), 5u);
  for (const Edge& e : shaft.edges) {
    EXPECT_EQ(e.time_s, 0.0);
    EXPECT_EQ(e.direction, 1);
  }
  EXPECT_EQ(shaft.state.count, 105);
  expect_list_and_state_agree(shaft);
  shaft.faults = {};
  shaft.move_counts(1.0);
  ASSERT_EQ(shaft.edges.size(), 6u);
  EXPECT_EQ(shaft.edges[4].count, 100);
  EXPECT_EQ(shaft.edges[4].time_s, 0.0);
  EXPECT_EQ(shaft.state.count, 101);
  EXPECT_EQ(shaft.state.direction_changed, 1);
  expect_list_and_state_agree(shaft);
}

}  // namespace
}  // namespace drivebench::encoder_faults_test
