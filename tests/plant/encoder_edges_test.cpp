#include "plant/sensors/encoder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "tests/plant/encoder_motion.hpp"

namespace drivebench::encoder_edges_test {
namespace {

using namespace encoder_motion;

/// Every edge by the quadratic formula, in extended precision.
std::vector<Edge> closed_form_edges(const Motion& m, int counts, double offset) {
  const long double per_rad = counts / (2.0L * std::numbers::pi_v<long double>);
  const auto wide = [](double x) { return static_cast<long double>(x); };
  const long double tick_s = wide(kTick_s);
  const long double c = wide(m.angle_rad) * per_rad + wide(offset);
  const long double b = wide(m.speed_rad_s) * per_rad;
  const long double a = 0.5L * wide(m.acceleration_rad_s2) * per_rad;
  const long double turning_s = a != 0.0L ? -b / (2.0L * a) : -1.0L;
  std::vector<Edge> edges;
  const auto monotonic = [&](long double from, long double to) {
    const auto count_at = [&](long double t) {
      return static_cast<std::int64_t>(std::floor(c + t * (b + t * a)));
    };
    const std::int64_t last = count_at(to);
    const int direction = last > count_at(from) ? 1 : -1;
    for (std::int64_t count = count_at(from); count != last;) {
      const long double height = c - static_cast<long double>(direction > 0 ? count + 1 : count);
      count += direction;
      const long double root = std::sqrt(std::max(b * b - 4.0L * a * height, 0.0L));
      // The slope b + 2at at the edge has the sign of the direction; the quotient without cancellation.
      long double t = b * direction >= 0.0L ? -2.0L * height / (b + direction * root)
                                            : (-b + direction * root) / (2.0L * a);
      t = std::clamp(t, from, to);
      edges.push_back({.time_s = static_cast<double>(t), .count = count, .direction = direction});
    }
  };
  if (turning_s > 0.0L && turning_s < tick_s) {
    monotonic(0.0L, turning_s);
    monotonic(turning_s, tick_s);
  } else {
    monotonic(0.0L, tick_s);
  }
  return edges;
}

// Random constant accelerations, among them reversals, up to 400 counts per tick. Catches: interpolation that
// is linear or ignores the speeds, boundaries off by a count, edges lost or doubled at node, turn or
// reversal.
TEST(EncoderEdges, EdgesComeAtTheClosedFormTimesAtConstantAcceleration) {
  std::mt19937_64 engine(21);
  const auto draw = [&engine](double size) {
    return std::uniform_real_distribution<double>(-size, size)(engine);
  };
  int reversals = 0;
  std::size_t total = 0;
  double worst_s = 0.0;
  for (int i = 0; i < 20'000; ++i) {
    const bool half = i % 2 == 0;
    const int counts = i % 3 == 0 ? 50'000 : 2000;
    const Encoder encoder({.counts_per_revolution = counts, .half_count_offset = half}, kTick_s);
    const double speed_rad_s = draw(i % 5 == 0 ? 1.0 : 400.0);
    // Every third one turns back within the tick.
    const double acceleration = i % 3 == 1 ? -speed_rad_s / (kTick_s * (0.5 + 0.5 * draw(0.9))) : draw(3e4);
    const Motion m{kTurn_rad * (0.5 + draw(0.5)), speed_rad_s, acceleration};
    if (m.speed_at(0.0) * m.speed_at(kTick_s) < 0.0) ++reversals;
    const std::vector<Edge> expected = closed_form_edges(m, counts, half ? 0.5 : 0.0);
    const std::vector<Edge> found = edges_of(encoder, m);
    ASSERT_EQ(found.size(), expected.size()) << i;
    for (std::size_t e = 0; e < found.size(); ++e) {
      ASSERT_EQ(found[e].count, expected[e].count);
      ASSERT_EQ(found[e].direction, expected[e].direction);
      worst_s = std::max(worst_s, std::abs(found[e].time_s - expected[e].time_s));
    }
    total += found.size();
  }
  EXPECT_LT(worst_s, kTimeTolerance_s);
  EXPECT_GT(reversals, 4000);
  EXPECT_GT(total, 300'000u);
}

// 1e5 counts in a tick, 1.25 ns each, with few and with many counts per turn. Catches: a speed ceiling, an
// error that grows with the speed.
TEST(EncoderEdges, AHundredThousandCountsInATickAreAllThere) {
  for (const int counts : {4, 2000, 100'000'000}) {
    const double speed_rad_s = 1e5 / counts * kTurn_rad / kTick_s;
    for (const double sign : {1.0, -1.0}) {
      const Encoder encoder({.counts_per_revolution = counts}, kTick_s);
      const Motion m{0.3, sign * speed_rad_s, 0.02 * speed_rad_s / kTick_s};
      const std::vector<Edge> expected = closed_form_edges(m, counts, 0.0);
      const std::vector<Edge> found = edges_of(encoder, m);
      ASSERT_EQ(found.size(), expected.size());
      ASSERT_GT(found.size(), 98'000u);
      double worst_s = 0.0;
      for (std::size_t e = 0; e < found.size(); ++e) {
        ASSERT_EQ(found[e].count, expected[e].count);
        worst_s = std::max(worst_s, std::abs(found[e].time_s - expected[e].time_s));
      }
      EXPECT_LT(worst_s, 1e-12);
      const EncoderState state = followed(encoder, m);
      EXPECT_EQ(state.count, expected.back().count);
      const std::size_t n = expected.size();
      EXPECT_NEAR(state.last_edge_s, expected[n - 1].time_s, 1e-12);
      EXPECT_NEAR(state.period_s, expected[n - 1].time_s - expected[n - 2].time_s, 2e-12);
    }
  }
}

// Catches: one line that changes twice, or both lines at once, on the way.
TEST(EncoderEdges, DecodingTheLinesGivesTheCountAgain) {
  const Encoder encoder({.counts_per_revolution = 400}, kTick_s);
  Motion m{3.0, 300.0, -1.5e5};  // stops after 2 ms and comes back
  std::int64_t decoded = encoder.count_at(m.angle_rad, 0);
  std::uint32_t lines = encoder.levels({.count = decoded}) & (kLevelA | kLevelB);
  EncoderState state = start(encoder, m.angle_rad);
  for (Tick tick = 0; tick < 40; ++tick) {
    for (const Edge& edge : edges_of(encoder, m)) {
      const std::uint32_t now = encoder.levels({.count = edge.count}) & (kLevelA | kLevelB);
      ASSERT_TRUE((now ^ lines) == kLevelA || (now ^ lines) == kLevelB);
      // A decoder as in a drive: a change of A with A != B, or of B with A == B, is one count up.
      const bool a_changed = (now ^ lines) == kLevelA;
      const bool equal = now == 0 || now == (kLevelA | kLevelB);
      decoded += a_changed != equal ? 1 : -1;
      lines = now;
      ASSERT_EQ(decoded, edge.count);
    }
    encoder.follow(state, segments_of(m), tick, 0);
    ASSERT_EQ(decoded, state.count);
    m = m.next();
  }
}

// Segments whose angle turns back once or twice within them, as a stiff machine may do. At each edge the
// cubic is on the boundary, and between two edges its count is the one they name. Catches: a cut that is left
// out, a wiggle that passes for monotonic.
TEST(EncoderEdges, EveryReversalOfASegmentIsSeen) {
  constexpr double kQuantum_rad = kTurn_rad / 2000;
  const Encoder encoder({.counts_per_revolution = 2000}, kTick_s);
  std::mt19937_64 engine(22);
  std::uniform_real_distribution<double> draw(-8.0, 8.0);
  int triple = 0;
  for (int i = 0; i < 20'000; ++i) {
    const double start = 100.0 + draw(engine);
    const double end = start + 0.2 * draw(engine);
    const double start_slope = draw(engine);
    const double end_slope = draw(engine);
    const double per_rad_s = kQuantum_rad / kTick_s;
    const AngleSegment segment{.start_s = 0.0,
                               .duration_s = kTick_s,
                               .start_rad = start * kQuantum_rad,
                               .end_rad = end * kQuantum_rad,
                               .start_rad_s = start_slope * per_rad_s,
                               .end_rad_s = end_slope * per_rad_s};
    const auto cubic = [&](double s) {  // the Hermite polynomials
      return start * (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s) + end * s * s * (3.0 - 2.0 * s) +
             start_slope * s * (1.0 - s) * (1.0 - s) - end_slope * s * s * (1.0 - s);
    };
    auto count = static_cast<std::int64_t>(std::floor(start));
    double last = 0.0;
    int turned = 0;
    int direction = 0;
    const auto check_until = [&](double s) {
      for (int part = 1; part < 20; ++part) {
        const double at = cubic(last + (s - last) * part / 20.0);
        ASSERT_GT(at, static_cast<double>(count) - 1e-6) << i;
        ASSERT_LT(at, static_cast<double>(count) + 1.0 + 1e-6) << i;
      }
    };
    encoder.for_each_edge(std::span(&segment, 1), 0, count, [&](const Edge& e) {
      const double s = e.time_s / kTick_s;
      ASSERT_GE(s, last - 1e-9);
      check_until(s);
      ASSERT_EQ(e.count, count + e.direction);
      ASSERT_NEAR(cubic(s), static_cast<double>(std::max(e.count, count)), 1e-6);
      count = e.count;
      last = s;
      if (direction != 0 && direction != e.direction) ++turned;
      direction = e.direction;
    });
    check_until(1.0);
    ASSERT_EQ(count, static_cast<std::int64_t>(std::floor(end)));
    if (turned == 2) ++triple;
  }
  EXPECT_GT(triple, 100);
}

}  // namespace
}  // namespace drivebench::encoder_edges_test
