// An axis at gate level: legs by their timers, time in picoseconds.
#include "plant/gate_axis.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "plant/drive/phases.hpp"
#include "plant/injected_faults.hpp"
#include "tests/plant/bridge_rig.hpp"
#include "tests/plant/gate_course.hpp"

namespace drivebench::gate_axis_test {
namespace {

using namespace bridge_rig;
using namespace gate_course;

bool same(const GateEdge& a, const GateEdge& b) {
  return a.at == b.at && a.kind == b.kind && a.channel == b.channel && a.level == b.level;
}

constexpr auto kAnyState = [](const AxisState&) noexcept { return true; };

constexpr Picoseconds kStep = 1'234'567'891;  // on no grid
constexpr int kSteps = 30;

// Catches: a piece that ends where the client asks, noise or an edge that depends on when it is asked for.
TEST(GateAxis, NothingDependsOnHowTheRunIsDivided) {
  GateCourse whole(turning_motor());
  for (int n = 0; n < kSteps; ++n) {
    whole.set_step(n % 6);
    whole.run((n + 1) * kStep, 64);
  }
  GateCourse parts(turning_motor());
  std::mt19937_64 random(3);
  std::uniform_int_distribution<Picoseconds> part(1, 40 * kMicro);
  for (int n = 0; n < kSteps; ++n) {
    if (n % 2 == 1) parts.axis.look();
    parts.set_step(n % 6);
    const Picoseconds end = (n + 1) * kStep;
    while (parts.axis.now() < end) {
      const Picoseconds until = std::min(end, parts.axis.now() + part(random));
      if (random() % 4 == 0) {
        const auto next = parts.axis.next_edge(until + part(random));
        if (next.has_value()) {
          EXPECT_GE(next->at, parts.axis.now());
        }
      }
      if (random() % 8 == 0) parts.axis.look();
      parts.run(until, 1 + random() % 3);
    }
  }
  ASSERT_GT(whole.edges.size(), 300U);
  ASSERT_EQ(whole.edges.size(), parts.edges.size());
  for (std::size_t n = 0; n < whole.edges.size(); ++n)
    ASSERT_TRUE(same(whole.edges[n], parts.edges[n])) << n << " at " << whole.edges[n].at;
  const GateAxis::Now a = whole.axis.look();
  const GateAxis::Now b = parts.axis.look();
  EXPECT_GT(std::abs(a.state.shaft.speed_rad_s), 10.0);
  EXPECT_EQ(a.state.machine, b.state.machine);
  EXPECT_EQ(a.state.shaft.angle_rad, b.state.shaft.angle_rad);
  EXPECT_EQ(a.sums.link_j, b.sums.link_j);
  EXPECT_EQ(a.sums.terminal_vs.c, b.sums.terminal_vs.c);
}

// Catches: a state that was read at an instant and is shown there again after a leg has been set.
TEST(GateAxis, ALegThatIsSetWhereTheStateWasReadShows) {
  GateCourse course(turning_motor());
  course.axis.set_leg(1, {.mode = LegMode::kLow});
  course.axis.run(kStep, {});
  EXPECT_EQ(course.axis.look().levels[0], LegLevel::kOff);
  course.axis.set_leg(0, {.mode = LegMode::kHigh});
  course.axis.next_edge(2 * kStep);
  EXPECT_EQ(course.axis.look().levels[0], LegLevel::kHigh);
}

/// The current of the motor at each end of a PWM period, in six steps of 400 us, on so many substeps.
std::vector<double> currents_on_battery(int substeps) {
  GateCourse course(turning_motor(), substeps);
  std::vector<double> current_a;
  for (int n = 0; n < 20; ++n) {
    course.set_step(n % 6, 0.9);
    for (int period = 1; period <= 20; ++period) {
      course.axis.run((20 * n + period) * 20 * kMicro, {});
      current_a.push_back(course.axis.look().state.machine[0]);
    }
  }
  return current_a;
}

// Six steps at 0.9 of a battery with R C = 15 us: up to 100 A, which pull the link down by 3 V. Against 64
// steps of a tick of 50 us the currents err by 0.25 A in one step for what no edge divides, by 0.03 A in 8.
// Catches: a machine on the rails of the start of a step, which errs by 1.9 and 0.6 A; currents of diodes
// that count for the wrong rail.
TEST(GateAxis, TheLinkOfABatteryMovesWithinAStep) {
  const std::vector<double> tight_a = currents_on_battery(64);
  EXPECT_GT(*std::max_element(tight_a.begin(), tight_a.end()), 80.0);
  for (const auto& [substeps, most_a] : {std::pair{1, 0.3}, std::pair{8, 0.05}}) {
    const std::vector<double> found_a = currents_on_battery(substeps);
    for (std::size_t n = 0; n < found_a.size(); ++n)
      ASSERT_NEAR(found_a[n], tight_a[n], most_a) << substeps << " " << n;
  }
}

// Catches: an edge that is told twice or lost where a leg is set just beside it, levels that do not
// alternate.
TEST(GateAxis, LevelsAlternateWhereverLegsAreSet) {
  GateCourse course(turning_motor());
  std::mt19937_64 random(5);
  std::uniform_int_distribution<Picoseconds> part(1, 60 * kMicro);
  int step = 0;
  while (course.axis.now() < 40 * kMilli) {
    const auto next = course.axis.next_edge(course.axis.now() + part(random));
    course.run(next && random() % 2 == 0
                   ? std::max(course.axis.now(), next->at - 1 + static_cast<Picoseconds>(random() % 3))
                   : course.axis.now() + part(random),
               8);
    course.set_step(step = (step + (random() % 20 == 0 ? 1 : 0)) % 6);
    course.axis.set_leg(static_cast<std::size_t>(random() % 3),
                        pwm(0.1 + 0.01 * static_cast<double>(random() % 30)));
  }
  std::uint64_t levels = 0;
  std::array<std::uint64_t, 3> edges{};
  std::uint32_t hall = 5;
  for (const GateEdge& edge : course.edges) {
    if (edge.kind == EventKind::kComparator) {
      ASSERT_NE(levels >> edge.channel & 1U, edge.level) << edge.at;
      levels ^= std::uint64_t{1} << edge.channel;
      ++edges[edge.channel];
    } else if (edge.kind == EventKind::kHall) {
      ASSERT_NE(hall >> edge.channel & 1U, edge.level) << edge.at;
      hall ^= 1U << edge.channel;
    }
  }
  const GateAxis::Now now = course.axis.look();
  EXPECT_EQ(now.state.comparators.levels, levels);
  EXPECT_EQ(now.state.comparators.edges, edges);
  EXPECT_GT(edges[0], 100U);
}

// Catches: a count that stands still, or one that a part which was taken back has moved.
TEST(GateAxis, TheEncoderCountsTheAngle) {
  AxisParameters p = turning_motor();
  p.encoder.counts_per_revolution = 4096;
  const Encoder encoder(p.encoder, 1e-9 * kPeriodNs);
  GateCourse course(p);
  for (int n = 0; n < kSteps; ++n) {
    course.set_step(n % 6);
    course.run((n + 1) * kStep, 64);
    const AxisState state = course.axis.look().state;
    ASSERT_EQ(state.encoder.count, encoder.count_at(state.shaft.angle_rad, state.turns)) << n;
  }
  EXPECT_GT(std::abs(course.axis.look().state.encoder.count), 1000);
}

// The mean of a nanosecond is within 10 mV of the voltages at its ends, unless a switch or a diode changes in
// it: the emf and the current of the diodes go by far less. Catches: terminals that are read as they were at
// the end of another part, or before a current has died.
TEST(GateAxis, TheTerminalsThatAreReadAreThoseThatAreIntegrated) {
  constexpr Picoseconds kNano = 1'000;
  GateCourse course(turning_motor());
  std::mt19937_64 random(11);
  std::uniform_int_distribution<Picoseconds> part(1, 40 * kMicro);
  int compared = 0;
  for (int n = 0; n < 1000; ++n) {
    course.set_step(n / 40 % 6);
    course.run(course.axis.now() + part(random), 8);
    const GateAxis::Now from = course.axis.look();
    course.run(course.axis.now() + kNano, 8);
    const GateAxis::Now to = course.axis.look();
    const auto mean_v = [](double first_vs, double last_vs) { return (last_vs - first_vs) / 1e-9; };
    const ThreePhase v = by_phase(mean_v, from.sums.terminal_vs, to.sums.terminal_vs);
    if (from.levels != to.levels || from.state.open_terminals != to.state.open_terminals) continue;
    ASSERT_NEAR(v.a, to.state.terminal_v.a, 10e-3) << n;
    ASSERT_NEAR(v.b, to.state.terminal_v.b, 10e-3) << n;
    ASSERT_NEAR(v.c, to.state.terminal_v.c, 10e-3) << n;
    ++compared;
  }
  EXPECT_GT(compared, 900);
}

// The closed form of R and L with a constant voltage between two legs: i = U/(2R) (1 - exp(-t/T)). Catches: a
// leg that acts a piece late, a time in the wrong unit, a piece whose end is not the instant that is asked
// for.
TEST(GateAxis, TheCurrentAtAnyInstantIsThatOfTheClosedForm) {
  GateAxis axis(standing_motor(), kPeriodNs, 16, 1, 0);
  axis.run(12'345'678, {});
  axis.set_leg(0, {.mode = LegMode::kHigh});
  axis.set_leg(1, {.mode = LegMode::kLow});
  for (const Picoseconds after : {1L, 999L, 1'234'567L, 77'777'777L, 400'000'001L}) {
    axis.run(12'345'678 + after, {});
    const double t = 1e-12 * static_cast<double>(after);
    const double expected_a = 0.5 * kLink_v / kResistance_ohm * -std::expm1(-t / kTime_s);
    // a step of the integration is at most T/128: (1/128)^4/120 of the change
    EXPECT_NEAR(axis.look().truth.current_a.a, expected_a,
                1e-10 * 0.5 * kLink_v / kResistance_ohm + 1e-9 * expected_a)
        << after;
  }
}

// Catches: a mean of another interval, a dead time on the wrong side, compare counts in the wrong sense.
// While current flows out of leg a, its lower diode carries it in the dead time: the terminal is low for it.
TEST(GateAxis, VoltSecondsAreThoseOfCompareAndDeadTime) {
  AxisParameters p = standing_motor();
  GateAxis axis(p, kPeriodNs, 16, 1, 0);
  constexpr Picoseconds kPwm = 33'333'333;
  constexpr Picoseconds kDead = 700'000;
  axis.set_leg(0, pwm(0.4, kPwm, kDead));
  axis.set_leg(1, {.mode = LegMode::kLow});
  axis.set_leg(2, {.mode = LegMode::kLow});
  axis.run(20 * kPwm, {});
  const GateSums before = axis.look().sums;
  axis.run(30 * kPwm, {});
  const GateSums after = axis.look().sums;
  const double high_s = 1e-12 * static_cast<double>(10 * (static_cast<Picoseconds>(0.4 * kPwm) - kDead));
  EXPECT_NEAR(after.terminal_vs.a - before.terminal_vs.a, kLink_v * high_s, 1e-12 * kLink_v);
  EXPECT_NEAR(after.terminal_vs.b - before.terminal_vs.b, 0.0, 1e-15);
}

// Catches: a loss that is counted twice or not at all, a magnetic energy of another instant, an integral of
// the second order: the balance of a run with dead times, diodes and a floating phase.
TEST(GateAxis, TheEnergiesAddUp) {
  AxisParameters p = turning_motor();
  p.drive.inverter.switch_ohm = 5e-3;
  p.drive.inverter.diode_v = 0.8;
  GateCourse course(p);
  for (int n = 0; n < kSteps; ++n) {
    course.set_step(n % 6);
    course.run((n + 1) * kStep, 64);
  }
  const GateAxis::Now now = course.axis.look();
  const GateSums& s = now.sums;
  EXPECT_GT(s.copper_j, 1e-3);
  EXPECT_GT(s.link_j, s.electrical_j);
  // Simpson's rule on pieces of at most 12.5 us, a thirtieth of the time constant: (1/32)^4/2880 is 3e-10
  EXPECT_NEAR(s.electrical_j, s.copper_j + s.shaft_j + now.truth.magnetic_j, 1e-8 * s.electrical_j);
}

// Catches: a state that leaves out timers, what has been told, or the events that are still to be handed out.
TEST(GateAxis, ASavedStateGoesOnToTheBit) {
  GateCourse first(turning_motor());
  for (int n = 0; n < 10; ++n) {
    first.set_step(n % 6);
    first.run((n + 1) * kStep, 64);
  }
  first.run(10 * kStep + 3 * kMicro, 64);
  first.axis.next_edge(11 * kStep);
  const std::vector<std::byte> saved = first.axis.save();
  GateCourse second(turning_motor());
  ASSERT_TRUE(second.axis.restore(saved, kAnyState));
  first.edges.clear();
  for (GateCourse* course : {&first, &second}) {
    course->run(11 * kStep, 64);
    course->set_step(4);
    course->run(14 * kStep, 64);
  }
  ASSERT_GT(first.edges.size(), 20U);
  ASSERT_EQ(first.edges.size(), second.edges.size());
  for (std::size_t n = 0; n < first.edges.size(); ++n)
    EXPECT_TRUE(same(first.edges[n], second.edges[n]));
  EXPECT_EQ(first.axis.look().state.machine, second.axis.look().state.machine);
  EXPECT_FALSE(second.axis.restore(std::span(saved).first(saved.size() - 8), kAnyState));
}

// Catches: a current zero that is not told, told late, or that a phase which is open brings again.
TEST(GateAxis, ACurrentThatDiesIsTold) {
  GateAxis axis(standing_motor(), kPeriodNs, 16, 1, 0);
  axis.set_leg(0, {.mode = LegMode::kHigh});
  axis.set_leg(1, {.mode = LegMode::kLow});
  axis.run(100 * kMicro, {});
  const double from_a = axis.look().truth.current_a.a;
  axis.set_leg(0, {});
  axis.set_leg(1, {});
  std::array<GateEdge, 4> edges;
  ASSERT_EQ(axis.run(2 * kMilli, edges), 2U);  // the last two together; c has none
  // against the link: t = T ln(1 + 2 R i/U)
  const double expected_s = kTime_s * std::log1p(2.0 * kResistance_ohm * from_a / kLink_v);
  EXPECT_EQ(edges[0].kind, EventKind::kCurrentZero);
  EXPECT_NEAR(1e-12 * static_cast<double>(edges[0].at - 100 * kMicro), expected_s, 2e-12);  // a rounded time
}

// The break input opens the legs 17 us after the current has passed its limit, shortly before a tick ends. In
// the next tick the client clears the fault while the current is still beyond the limit: the break input
// opens the legs once more, 17 us later. Catches: a break input that waits for the next tick if the client
// does not read the state.
TEST(GateAxis, AClearedBreakIsPulledAgainAtOnceWhoeverReads) {
  AxisParameters p = standing_motor();
  p.drive.inverter.break_current_a = 9.0;
  p.drive.inverter.break_delay_s = 17e-6;
  std::array<std::vector<GateEdge>, 2> told;
  for (const bool reads : {false, true}) {
    GateAxis axis(p, kPeriodNs, 2, 1, 0);
    axis.set_leg(0, {.mode = LegMode::kHigh});
    axis.set_leg(1, {.mode = LegMode::kLow});
    std::array<GateEdge, 16> edges;
    std::size_t count = axis.run(52 * kMicro, edges);
    ASSERT_EQ(count, 1U);
    EXPECT_EQ(edges[0].kind, EventKind::kBreak);
    axis.clear_faults();
    if (reads) {
      EXPECT_GT(axis.look().truth.current_a.a, 9.5);
    }
    count = axis.run(85 * kMicro, edges);
    told[reads ? 1 : 0].assign(edges.begin(), edges.begin() + static_cast<std::ptrdiff_t>(count));
  }
  ASSERT_EQ(told[0].size(), 1U);
  ASSERT_EQ(told[1].size(), 1U);
  EXPECT_TRUE(same(told[0][0], told[1][0]));
  EXPECT_NEAR(1e-12 * static_cast<double>(told[0][0].at), 69e-6, 1e-10);
}

// Catches: a load of the tick that has ended, or the ramp of one that has not begun.
TEST(GateAxis, ALoadIsReadFromTheInstantOfItsSetting) {
  GateAxis axis(turning_motor(), kPeriodNs, 4, 1, 0);
  axis.run(1000 * kPeriodNs * 7, {});
  axis.set_load(0.01);
  EXPECT_EQ(axis.look().truth.load_nm, 0.01);
  axis.set_load(0.01);
  EXPECT_EQ(axis.look().truth.load_nm, 0.01);
  axis.run(1000 * kPeriodNs * 7 + 12'345, {});
  EXPECT_EQ(axis.look().truth.load_nm, 0.01);
}

// Catches: a stiff link whose voltage waits for the next tick.
TEST(GateAxis, AStiffLinkHasItsNewVoltageAtOnce) {
  AxisParameters p = standing_motor();
  GateAxis axis(p, kPeriodNs, 4, 1, 0);
  axis.run(100 * kMicro + 7 * kMicro, {});
  p.drive.bus.voltage_v = 0.5 * kLink_v;
  axis.set_parameters(p);
  axis.run(axis.now() + 1000, {});
  EXPECT_EQ(axis.look().state.drive.bus_v, 0.5 * kLink_v);
  axis.inject(find_injectable_fault("bus_sag"), 0.5);
  axis.run(axis.now() + 1000, {});
  EXPECT_EQ(axis.look().state.drive.bus_v, 0.25 * kLink_v);
}

}  // namespace
}  // namespace drivebench::gate_axis_test
