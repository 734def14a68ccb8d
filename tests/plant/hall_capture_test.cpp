// The capture of the Hall lines: how many edges they had, and when the last one came.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "plant/sensors/hall.hpp"
#include "tests/plant/bridge_rig.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::hall_capture_test {
namespace {

constexpr double kTick_s = 100e-6;
constexpr double kPolePairs = 3.0;
constexpr double kOffset_rad = 0.2;
constexpr HallParameters kHall{
    .enabled = true, .offset_rad = kOffset_rad, .capture_bits = 16, .capture_hz = 72e6};

/// A rotor whose acceleration is constant within each tick, and what an oracle that knows all roots has seen.
struct Rotor {
  double angle_rad = 0.0;
  double speed_rad_s = 0.0;
  std::uint64_t edges = 0;
  Tick edge_tick = 0;
  double edge_s = 0.0;

  double after(double time_s, double acceleration) const {
    return angle_rad + speed_rad_s * time_s + 0.5 * acceleration * time_s * time_s;
  }
  static std::int64_t sector(double angle_rad, double offset_rad) {
    return static_cast<std::int64_t>(
        std::floor((kPolePairs * angle_rad - offset_rad) * 3.0 / std::numbers::pi + 0.5));
  }

  /// The instants at which the angle passes a boundary between two sectors, all of them in order.
  std::vector<double> crossings(double acceleration, double offset_rad) const {
    std::vector<double> found;
    const double turn = -speed_rad_s / acceleration;  // where it reverses
    const double extreme = turn > 0.0 && turn < kTick_s ? after(turn, acceleration) : angle_rad;
    const double end = after(kTick_s, acceleration);
    const std::int64_t low = sector(std::min({angle_rad, extreme, end}), offset_rad);
    const std::int64_t high = sector(std::max({angle_rad, extreme, end}), offset_rad);
    for (std::int64_t k = low + 1; k <= high; ++k) {
      const double boundary_rad =
          ((static_cast<double>(k) - 0.5) * std::numbers::pi / 3.0 + offset_rad) / kPolePairs;
      const double root =
          std::sqrt(speed_rad_s * speed_rad_s - 2.0 * acceleration * (angle_rad - boundary_rad));
      for (const double sign : {-1.0, 1.0}) {
        // The stable form of (-v +- root)/a.
        const double q = -(speed_rad_s + std::copysign(root, speed_rad_s));
        const double t =
            (sign > 0.0) == (speed_rad_s > 0.0) ? 2.0 * (angle_rad - boundary_rad) / q : q / acceleration;
        if (t > 0.0 && t < kTick_s) found.push_back(t);
      }
    }
    std::sort(found.begin(), found.end());
    return found;
  }

  void advance(double acceleration, Tick tick, double offset_rad, const InjectedFaults& faults) {
    const std::vector<double> at_s = crossings(acceleration, offset_rad);
    for (std::size_t n = 0; n < at_s.size(); ++n) {
      const double before_s = n > 0 ? at_s[n - 1] : 0.0;
      const double after_s = n + 1 < at_s.size() ? at_s[n + 1] : kTick_s;
      const auto lines = [&](double from_s, double to_s) {
        return hall_lines_in(sector(after(0.5 * (from_s + to_s), acceleration), offset_rad), faults);
      };
      if (lines(before_s, at_s[n]) == lines(at_s[n], after_s)) continue;
      ++edges;
      edge_tick = tick;
      edge_s = at_s[n];
    }
    angle_rad = after(kTick_s, acceleration);
    speed_rad_s += acceleration * kTick_s;
  }
};

/// The tick in two segments, within the turn in which it starts.
std::vector<AngleSegment> segments_of(const Rotor& rotor, double acceleration, double turn_rad) {
  const double half_s = 0.37 * kTick_s;
  const auto part = [&](double from_s, double to_s) -> AngleSegment {
    return {.start_s = from_s,
            .duration_s = to_s - from_s,
            .start_rad = rotor.after(from_s, acceleration) - turn_rad,
            .end_rad = rotor.after(to_s, acceleration) - turn_rad,
            .start_rad_s = rotor.speed_rad_s + acceleration * from_s,
            .end_rad_s = rotor.speed_rad_s + acceleration * to_s};
  };
  return {part(0.0, half_s), part(half_s, kTick_s)};
}

/// So many ticks at random under these faults. Whether every edge and every time was that of the oracle.
void run_at_random(const InjectedFaults& faults, double largest_rad_s, double largest_rad_s2) {
  std::mt19937_64 random(20);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  const HallCapture hall(kHall, kPolePairs, kTick_s);
  HallMemory m = hall.settled();
  m.lines = hall_lines_in(m.sector, faults);
  Rotor rotor;
  for (Tick tick = 0; tick < 3000; ++tick) {
    const double wanted_rad_s = largest_rad_s * any(random);
    const double acceleration =
        std::clamp((wanted_rad_s - rotor.speed_rad_s) / kTick_s, -largest_rad_s2, largest_rad_s2);
    const auto turn = static_cast<std::int64_t>(std::floor(rotor.angle_rad / kTurnRad));
    const auto segments = segments_of(rotor, acceleration, static_cast<double>(turn) * kTurnRad);
    rotor.advance(acceleration, tick, kOffset_rad, faults);
    hall.follow(m, segments, tick, turn, faults);
    ASSERT_EQ(m.edges, rotor.edges) << tick;
    ASSERT_EQ(m.edge_tick, rotor.edge_tick) << tick;
    // Where it reverses on a boundary, the root is as uncertain as that of the rounding of the angle.
    ASSERT_NEAR(m.edge_s, rotor.edge_s, 1e-11) << tick;
    ASSERT_EQ(m.lines, hall_lines_in(Rotor::sector(rotor.angle_rad, kOffset_rad), faults)) << tick;
  }
  EXPECT_GT(m.edges, 500u);
}

// Slow, with reversals in many ticks, and fast, with up to seven edges in a tick. Catches: an edge that is
// lost or doubled where the angle wraps or reverses, the first edge of a tick in place of the last one, a
// boundary that is off by a sector in one direction, an offset of the wrong sign or of the rotor, a straight
// line.
TEST(HallCapture, EveryEdgeIsCountedAndTheLastOneHasItsInstant) {
  run_at_random({}, 1500.0, 3e7);
  run_at_random({}, 25'000.0, 5e8);
}

// Catches: edges of a line that is stuck, an edge of a live line that is lost beside it, a stuck line whose
// last edge is that of another tick.
TEST(HallCapture, AStuckLineHasNoEdges) {
  for (const double line : {1.0, 2.0, 3.0}) {
    run_at_random({.hall_stuck_low = line}, 25'000.0, 5e8);
    run_at_random({.hall_stuck_low = line == 3.0 ? 1.0 : line + 1.0, .hall_stuck_high = line}, 25'000.0, 5e8);
  }
}

// Catches: a fault whose edge is lost, comes late or comes again, lines that jump without an edge.
TEST(HallCapture, AFaultThatChangesTheLinesHasItsEdgeAtTheStartOfTheTick) {
  const HallCapture hall(kHall, kPolePairs, kTick_s);
  HallMemory m = hall.settled();
  const std::vector<AngleSegment> at_rest{{.start_s = 0.0,
                                           .duration_s = kTick_s,
                                           .start_rad = 0.0,
                                           .end_rad = 0.0,
                                           .start_rad_s = 0.0,
                                           .end_rad_s = 0.0}};
  EXPECT_EQ(m.lines, 5u);
  const auto edges_after = [&](const InjectedFaults& faults, Tick tick) {
    hall.follow(m, at_rest, tick, 0, faults);
    return m.edges;
  };
  EXPECT_EQ(edges_after({}, 0), 0u);
  EXPECT_EQ(edges_after({.hall_stuck_low = 2.0}, 1), 0u) << "line 2 is low there";
  EXPECT_EQ(edges_after({.hall_stuck_low = 1.0}, 2), 1u);
  EXPECT_EQ(edges_after({.hall_stuck_low = 1.0}, 3), 1u);
  EXPECT_EQ(edges_after({}, 4), 2u);
  EXPECT_EQ(edges_after({.hall_offset = 0.6}, 5), 3u) << "one sector";
  EXPECT_EQ(m.lines, 4u);
  EXPECT_EQ(edges_after({.hall_offset = 0.6 + 2.1}, 6), 4u) << "three sectors, one instant";
  EXPECT_EQ(m.edge_tick, 6);
  EXPECT_EQ(m.edge_s, 0.0);
  HallMemory turning = hall.settled();
  const std::vector<AngleSegment> forward{{.start_s = 0.0,
                                           .duration_s = kTick_s,
                                           .start_rad = 0.0,
                                           .end_rad = 0.01,
                                           .start_rad_s = 100.0,
                                           .end_rad_s = 100.0}};
  hall.follow(turning, forward, 1, 0, {.hall_offset = 0.6});
  EXPECT_EQ(turning.edges, 1u);
  EXPECT_EQ(turning.edge_s, 0.0) << "against the rotation";
}

// Catches: an age from the wrong end of the tick, a timer that counts from the edge before, saturates or
// rounds, one that starts at the last wrap.
TEST(HallCapture, TheSampleHasNumberAgeAndTimer) {
  const HallCapture hall(kHall, kPolePairs, kTick_s);
  Sample s;
  hall.read({.edges = 7, .edge_tick = 41, .edge_s = 30.005e-6}, 43, s);
  EXPECT_EQ(s.hall_edges, 7u);
  EXPECT_NEAR(s.hall_edge_age_s, 169.995e-6, 1e-15);
  EXPECT_EQ(s.hall_capture, 297'360u % 65'536u);  // 4.130005 ms of 72 MHz
  s = {};
  hall.read({}, 5, s);
  EXPECT_EQ(s.hall_capture, 0u);
  EXPECT_NEAR(s.hall_edge_age_s, 5.0 * kTick_s, 1e-15);
}

AxisParameters coasting(int capture_bits) {
  AxisParameters p = bridge_rig::standing_motor();
  p.sensors.hall = {
      .enabled = true, .capture_bits = capture_bits, .capture_hz = capture_bits > 0 ? 1e6 : 0.0};
  return p;
}

// A rotor with seven pole pairs that coasts at 300 rad/s: an edge each pi/21 rad. Catches: an axis that does
// not follow its lines, one that shows edges without a capture, a state that is saved without them.
TEST(HallCapture, AnAxisThatCoastsHasItsEdgesWhereTheLinesChange) {
  constexpr double kSpeed_rad_s = 300.0;
  Axis axis(coasting(16), bridge_rig::kTiming, 1, 0);
  Axis plain(coasting(0), bridge_rig::kTiming, 1, 0);
  spin(axis, kSpeed_rad_s);
  spin(plain, kSpeed_rad_s);
  std::uint64_t changes = 0;
  for (Tick tick = 0; tick < 200; ++tick) {
    const std::uint64_t before = axis.sample(tick).hall_lines;
    axis.advance({}, tick);
    plain.advance({}, tick);
    const Sample s = axis.sample(tick + 1);
    changes += s.hall_lines != before ? 1 : 0;
    ASSERT_EQ(s.hall_edges, changes);
    const Sample none = plain.sample(tick + 1);
    ASSERT_EQ(none.hall_edges + none.hall_capture, 0u);
    ASSERT_EQ(none.hall_edge_age_s, 0.0);
    if (changes == 0) continue;
    const double at_edge = (s.angle_rad - kSpeed_rad_s * s.hall_edge_age_s) * 21.0 / std::numbers::pi + 0.5;
    ASSERT_NEAR(at_edge, std::round(at_edge), 1e-9);
    Axis other(coasting(16), bridge_rig::kTiming, 1, 0);
    other.restore(axis.state());
    ASSERT_EQ(other.sample(tick + 1).hall_capture, s.hall_capture);
  }
  EXPECT_EQ(changes, 20u);  // 3 rad
}

// Catches: a capture without lines, a timer without bits or clock.
TEST(HallCapture, TheRulesNameWhatIsMissing) {
  const auto only = [](const HallParameters& hall) {
    AxisParameters p = servo_axis();
    p.sensors.hall = hall;
    const std::vector<Problem> found = problems(p);
    return found.size() == 1 ? found[0].field + " " + found[0].rule : std::to_string(found.size());
  };
  EXPECT_EQ(only(kHall), "0");
  EXPECT_EQ(only({.enabled = true, .capture_bits = 16}),
            "hall.capture_hz is 0 Hz and hall.capture_bits 16: both must be above 0, or none");
  EXPECT_EQ(only({.enabled = true, .capture_hz = 1e6}),
            "hall.capture_hz is 1e+06 Hz and hall.capture_bits 0: both must be above 0, or none");
  EXPECT_EQ(only({.capture_bits = 16, .capture_hz = 1e6}),
            "hall.capture_bits is 16 but needs hall.enabled = 1, which is 0");
}

}  // namespace
}  // namespace drivebench::hall_capture_test
