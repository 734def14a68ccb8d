// Edges of the legs within a tick.
#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <vector>

#include "plant/axis.hpp"
#include "tests/plant/bldc_motor.hpp"
#include "tests/plant/drive_rig.hpp"

namespace drivebench::edges_test {
namespace {

constexpr double kLink_v = 300.0;
constexpr std::uint32_t kTickNs = 100'000;  // that of the rig
using enum LegLevel;

LegEdgeList list(std::initializer_list<LegEdge> edges) {
  LegEdgeList result{};
  std::copy(edges.begin(), edges.end(), result.begin());
  return result;
}

PhaseCommand edges(const LegEdgeList& a, const LegEdgeList& b = {}, const LegEdgeList& c = {}) {
  return {.gates = Gates::kEdges, .edges = {a, b, c}};
}

DriveParameters inverter(double dead_time_s = 0.0) {
  DriveParameters p = plain_drive(DriveKind::kSwitched);
  p.amplifier.voltage_limit_v = 0.5 * kLink_v;
  p.amplifier.over_current_a = 1000.0;
  p.bus.voltage_v = kLink_v;
  p.inverter.dead_time_s = dead_time_s;
  return p;
}

/// Where leg a is during one tick: mode and level of each segment with its start.
struct Place {
  double start_s;
  TerminalMode mode;
  double voltage_v;
};

std::vector<Place> places(Drive& drive, DriveMemory& m, const PhaseCommand& command, Tick tick) {
  drive.begin_tick(m, command, {}, tick);
  std::vector<Place> result;
  for (double start_s = 0.0; start_s < kRigTick_s;) {
    const double stop_s = std::min(kRigTick_s, drive.next_edge_s(m, start_s));
    const TerminalDrive out = drive.at(m, start_s, stop_s - start_s, {});
    result.push_back({start_s, out.mode[0], out.mode[0] == TerminalMode::kDriven ? out.start_v.a : 0.0});
    start_s = stop_s;
  }
  return result;
}

struct Leg {
  explicit Leg(const DriveParameters& p)
      : drive(p, Connection::kStar, kRigTick_s, 1, 0), memory(drive.initial()) {}
  std::vector<Place> tick(const PhaseCommand& command) { return places(drive, memory, command, now++); }
  Drive drive;
  DriveMemory memory;
  Tick now = 0;
};

void expect(const std::vector<Place>& seen, std::initializer_list<Place> wanted) {
  ASSERT_EQ(seen.size(), wanted.size());
  for (std::size_t n = 0; n < seen.size(); ++n) {
    const Place& w = wanted.begin()[n];
    EXPECT_NEAR(seen[n].start_s, w.start_s, 1e-15) << n;
    EXPECT_EQ(seen[n].mode, w.mode) << n;
    EXPECT_EQ(seen[n].voltage_v, w.voltage_v) << n;
  }
}

constexpr TerminalMode kOn = TerminalMode::kDriven;
constexpr TerminalMode kFree = TerminalMode::kDiodes;
constexpr double kUp = 0.5 * kLink_v;

// Catches: an edge at another instant, a level of the wrong sign, an edge that is left out.
TEST(Edges, ALegGoesWhereItsListSaysAtItsInstants) {
  Leg leg(inverter());
  expect(leg.tick(edges(list({{0, kLow}, {10'000, kHigh}, {10'001, kLow}, {50'000, kOff}, {99'999, kHigh}}))),
         {{0.0, kOn, -kUp},
          {10e-6, kOn, kUp},
          {10.001e-6, kOn, -kUp},
          {50e-6, kFree, 0.0},
          {99.999e-6, kOn, kUp}});
}

// Catches: a leg that starts each tick off or low, that keeps its level where it has no list, or that takes
// over the last state of a PWM period.
TEST(Edges, ALegKeepsItsLevelUntilTheNextEdge) {
  Leg leg(inverter());
  expect(leg.tick(edges(list({{20'000, kHigh}}))), {{0.0, kFree, 0.0}, {20e-6, kOn, kUp}});
  expect(leg.tick(edges(list({{30'000, kLow}}))), {{0.0, kOn, kUp}, {30e-6, kOn, -kUp}});
  expect(leg.tick(edges(list({{40'000, kLow}}))), {{0.0, kOn, -kUp}, {40e-6, kOn, -kUp}});
  expect(leg.tick(edges({}, list({{0, kLow}}))), {{0.0, kFree, 0.0}});
  expect(leg.tick(edges(list({{30'000, kLow}}))), {{0.0, kFree, 0.0}, {30e-6, kOn, -kUp}});
  leg.tick({.gates = Gates::kDuty, .setpoint = {.a = 1.0, .b = 0.5, .c = 0.5}});
  expect(leg.tick(edges(list({{50'000, kLow}}))), {{0.0, kFree, 0.0}, {50e-6, kOn, -kUp}});
}

// A switch closes the dead time after the other one has opened, also over the end of a tick and after a time
// with both open. Catches: a dead time before the edge or after every edge, two switches that are closed at
// once, a pulse shorter than the dead time that shows.
TEST(Edges, ASwitchWaitsTheDeadTimeAfterTheOther) {
  Leg leg(inverter(1e-6));
  expect(leg.tick(edges(list(
             {{0, kHigh}, {20'000, kLow}, {40'000, kOff}, {40'400, kHigh}, {60'000, kOff}, {62'000, kLow}}))),
         {{0.0, kOn, kUp},
          {20e-6, kFree, 0.0},
          {21e-6, kOn, -kUp},
          {40e-6, kFree, 0.0},
          {40.4e-6, kFree, 0.0},
          {41e-6, kOn, kUp},
          {60e-6, kFree, 0.0},
          {62e-6, kOn, -kUp}});
  expect(leg.tick(edges(list({{0, kHigh}, {50'000, kLow}, {50'900, kHigh}}))),
         {{0.0, kFree, 0.0}, {1e-6, kOn, kUp}, {50e-6, kFree, 0.0}, {50.9e-6, kOn, kUp}});
  expect(leg.tick(edges(list({{99'700, kLow}}))), {{0.0, kOn, kUp}, {99.7e-6, kFree, 0.0}});
  expect(leg.tick(edges(list({{90'000, kLow}}))),
         {{0.0, kFree, 0.0}, {0.7e-6, kOn, -kUp}, {90e-6, kOn, -kUp}});
}

// With half a tick of delay a list begins in the middle of its tick and goes on in the next one. Catches:
// offsets that count from the start of the tick, the rest of a list that the next tick forgets.
TEST(Edges, ADelayedListCountsFromWhereItTakesOver) {
  DriveParameters p = inverter();
  p.amplifier.delay_ticks = 0.5;
  p.inverter.pwm_periods_per_tick = 2;
  Leg leg(p);
  expect(leg.tick(edges(list({{0, kLow}, {10'000, kHigh}, {70'000, kLow}}))),
         {{0.0, kFree, 0.0}, {50e-6, kOn, -kUp}, {60e-6, kOn, kUp}});
  expect(leg.tick(edges(list({{30'000, kHigh}}))),
         {{0.0, kOn, kUp}, {20e-6, kOn, -kUp}, {50e-6, kOn, -kUp}, {80e-6, kOn, kUp}});
}

// Volt-seconds: the times at the rails, and of the dead time the rail that the current comes from. Catches:
// an energy or a mean that takes a leg off for one at a rail.
TEST(Edges, TheVoltSecondsOfALegAreThoseOfItsTimes) {
  for (const double current_a : {5.0, -5.0}) {
    DriveRig rig(inverter(2e-6), Connection::kStar, {.inductance_h = 1e3});
    rig.current_a = {current_a, -0.5 * current_a, -0.5 * current_a};
    rig.tick(edges(list({{0, kLow}, {30'000, kHigh}, {70'000, kLow}}), list({{0, kLow}}), list({{0, kLow}})));
    // Both dead times are at the rail of the diode: 2 us up or down each.
    const double high_s = current_a > 0.0 ? 38e-6 : 42e-6;
    EXPECT_NEAR(rig.volt_seconds[0] + 0.5 * kLink_v * kRigTick_s, kLink_v * high_s, 1e-12);
    EXPECT_NEAR(rig.volt_seconds[1] + 0.5 * kLink_v * kRigTick_s, 0.0, 1e-12);
  }
}

// Centre-aligned edges without dead time are the pattern of a duty: one trajectory. Catches: legs in another
// order, a pattern that begins anew with each PWM period, a motor that the two drive differently.
TEST(Edges, CentredEdgesMoveTheMotorAsTheirDutiesDo) {
  AxisParameters p;
  p.machine = bldc_motor::kMotor;
  p.mechanics = {.inertia_kgm2 = bldc_motor::kInertia_kgm2,
                 .viscous_friction_nms = bldc_motor::kFriction_nms};
  p.drive = inverter();
  p.drive.amplifier.delay_ticks = 0.5;  // two PWM periods in a tick: the list begins in its middle
  p.drive.inverter.pwm_periods_per_tick = 2;
  p.sensors.terminals = true;
  Axis by_duty(p, {.period_s = kRigTick_s, .substeps = 4}, 1, 0);
  Axis by_edges(p, {.period_s = kRigTick_s, .substeps = 4}, 1, 0);
  constexpr std::uint32_t kPwmNs = kTickNs / 2;
  for (Tick tick = 0; tick < 300; ++tick) {
    PhaseCommand command{.gates = Gates::kEdges};
    std::array<double, 3> duty{};
    for (std::size_t leg = 0; leg < 3; ++leg) {
      const auto half =
          static_cast<std::uint32_t>(1000 * ((static_cast<std::size_t>(tick) / 20 + 3 * leg) % 9 + 2));
      duty[leg] = 2.0 * half / kPwmNs;
      const std::uint32_t middle = kPwmNs / 2;
      command.edges[leg] = list({{0, kLow},
                                 {middle - half, kHigh},
                                 {middle + half, kLow},
                                 {kPwmNs + middle - half, kHigh},
                                 {kPwmNs + middle + half, kLow}});
    }
    by_edges.advance(command, tick);
    by_duty.advance({.gates = Gates::kDuty, .setpoint = {.a = duty[0], .b = duty[1], .c = duty[2]}}, tick);
    const Sample a = by_edges.sample(tick + 1);
    const Sample b = by_duty.sample(tick + 1);
    ASSERT_NEAR(a.true_i_a_a, b.true_i_a_a, 1e-9) << tick;
    ASSERT_NEAR(a.true_i_c_a, b.true_i_c_a, 1e-9) << tick;
    ASSERT_NEAR(a.angle_rad, b.angle_rad, 1e-9) << tick;
    if (tick > 0) {
      ASSERT_NEAR(a.terminal_b_mean_v, b.terminal_b_mean_v, 1e-9) << tick;
    }
  }
  EXPECT_GT(std::abs(by_edges.sample(300).true_i_a_a), 0.1);
}

// The most that three legs can do: a switch that still waits when the tick begins, and eight edges with a
// dead time each. Catches: a pattern with too little room.
TEST(Edges, ThreeFullListsWithDeadTimesHaveRoom) {
  Leg leg(inverter(1e-6));
  LegEdgeList full{};
  for (std::uint32_t n = 0; n < kMaxLegEdges; ++n)
    full[n] = LegEdge(10'000 * (n + 1), n % 2 == 0 ? kLow : kHigh);
  const LegEdgeList waits = list({{0, kLow}, {kTickNs - 500, kHigh}});
  leg.tick(edges(waits, waits, waits));
  LegEdges shifted{full, full, full};
  for (std::size_t k = 1; k < 3; ++k)
    for (LegEdge& edge : shifted[k])
      edge = LegEdge(edge.offset_ns() + static_cast<std::uint32_t>(100 * k), edge.level());
  const std::vector<Place> seen = leg.tick(edges(shifted[0], shifted[1], shifted[2]));
  EXPECT_EQ(seen.size(), kMaxSegmentsOfPattern - 5)
      << "all start at 0, and end their first dead time together";
  EXPECT_EQ(seen.back().voltage_v, kUp);
}

// Catches: a damaged list that leaves the pattern without an end, or a leg that the mask does not hold.
TEST(Edges, AListOutOfOrderEndsAndTheMaskOfLegsHolds) {
  Leg leg(inverter(1e-6));
  LegEdgeList wild{};
  for (std::size_t n = 0; n < wild.size(); ++n)
    wild[n] = LegEdge(static_cast<std::uint32_t>((n * 37'000) % 250'000), n % 2 == 0 ? kHigh : kLow);
  EXPECT_LE(leg.tick(edges(wild, wild, wild)).size(), kMaxSegmentsOfPattern);
  PhaseCommand off = edges(list({{0, kHigh}, {50'000, kLow}}));
  off.legs_off = 1;
  for (const Place& place : leg.tick(off))
    EXPECT_EQ(place.mode, kFree);
}

}  // namespace
}  // namespace drivebench::edges_test
