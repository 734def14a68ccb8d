// The comparators of the terminals: crossings, hysteresis and noise by themselves, then on motors.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "plant/axis.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/plant/bldc_motor.hpp"
#include "tests/plant/drive_rig.hpp"

namespace drivebench::comparators_test {
namespace {

constexpr double kPeriod_s = 50e-6;
constexpr double kRc_s = 2e-6;

ComparatorParameters fixed_at(double reference_v, double rc_s = 0.0, double hysteresis_v = 0.02) {
  return {.enabled = true,
          .reference = ComparatorReference::kFixed,
          .reference_v = reference_v,
          .rc_s = rc_s,
          .hysteresis_v = hysteresis_v};
}

Comparators made(const ComparatorParameters& p, std::uint64_t seed = 1) {
  return Comparators(p, kPeriod_s, seed, 24);
}

/// Terminal a goes along f; the others stay at zero. The ends of the intervals are at these parts of a tick.
template <class Way>
ComparatorMemory followed(const Comparators& comparators, const Way& f, const std::vector<double>& ends,
                          ComparatorMemory m = {}, Tick tick = 0) {
  double start_s = 0.0;
  for (const double end : ends) {
    const double duration_s = end * kPeriod_s - start_s;
    comparators.follow(m, tick, start_s, duration_s,
                       {.start_v = {f(start_s), 0.0, 0.0},
                        .middle_v = {f(start_s + 0.5 * duration_s), 0.0, 0.0},
                        .end_v = {f(start_s + duration_s), 0.0, 0.0}});
    start_s += duration_s;
  }
  return m;
}

const std::vector<double> kWhole{1.0};
const std::vector<double> kParts{0.01, 0.0215, 0.1, 0.107, 0.35, 0.8, 1.0};

// A step and a ramp through an RC, by their closed forms: V (1 - e^(-t/RC)), s (t - RC + RC e^(-t/RC)). The
// time constant and the hysteresis count; the intervals do not. Catches: an edge at the end of an interval or
// by a straight line, an RC that starts anew with each interval, half of the hysteresis forgotten.
TEST(Comparators, AStepAndARampThroughAnRcCrossWhereTheirFormulasSay) {
  const Comparators comparators = made(fixed_at(0.0, kRc_s, 0.5));
  const double step_s = -kRc_s * std::log(1.0 - 0.25 / 3.0);
  const auto step = [](double) { return 3.0; };
  const auto ramp = [](double t) { return 2e5 * t; };
  for (const auto& ends : {kWhole, kParts}) {
    const ComparatorMemory m = followed(comparators, step, ends);
    EXPECT_EQ(m.levels, 1u);
    EXPECT_EQ(m.edges[0], 1u);
    EXPECT_EQ(m.edges[1], 0u);
    EXPECT_NEAR(m.edge_s[0], step_s, 1e-18);
    EXPECT_NEAR(m.filtered_v.a, 3.0, 1e-9);
    const ComparatorMemory r = followed(comparators, ramp, ends);
    const double t = r.edge_s[0];
    EXPECT_EQ(r.edges[0], 1u);
    EXPECT_NEAR(2e5 * (t - kRc_s + kRc_s * std::exp(-t / kRc_s)), 0.25, 1e-12);
  }
}

// Time constants from a ten-thousandth of the interval to a million times its length, against bisection of
// the closed form. Catches: a wrong root, one that is only near, a search that gives up where the transient
// is long over or has hardly begun.
TEST(Comparators, EveryTimeConstantCrossesWhereItsFormulaSays) {
  constexpr double kThreshold_v = 0.25;
  std::mt19937_64 random(5);
  const auto between = [&random](double from, double to) {
    return std::uniform_real_distribution(from, to)(random);
  };
  int crossed = 0;
  for (int n = 0; n < 20'000; ++n) {
    const double rc_s = kPeriod_s * std::pow(10.0, between(-4.0, 6.0));
    const double u0 = between(-3.0, 3.0);
    const double u1 = between(-3.0, 3.0) / kPeriod_s;
    const double charge_v = between(-3.0, kThreshold_v);
    const double transient_v = charge_v - (u0 - u1 * rc_s);
    const auto y_v = [&](double t) {
      // Of a slow transient what is left is a difference: expm1 keeps its digits.
      return charge_v + u1 * t + transient_v * std::expm1(-t / rc_s);
    };
    const ComparatorMemory m =
        followed(made(fixed_at(0.0, rc_s, 2.0 * kThreshold_v)), [&](double t) { return u0 + u1 * t; }, kWhole,
                 {.filtered_v = {charge_v, 0.0, 0.0}});
    const double rounding_v = 1e-14 * (std::abs(u0) + std::abs(u1 * rc_s) + std::abs(charge_v));
    EXPECT_NEAR(m.filtered_v.a, y_v(kPeriod_s), 10.0 * rounding_v + 1e-6 * kPeriod_s / rc_s) << rc_s;
    if (m.edges[0] != 1) continue;
    ++crossed;
    EXPECT_NEAR(y_v(m.edge_s[0]), kThreshold_v, 10.0 * rounding_v + 1e-12) << rc_s << " " << m.edge_s[0];
  }
  EXPECT_GT(crossed, 2000);
}

// Rounding of the terminals by their last digit, in intervals so short that nothing happens. Catches: a
// memory that is lost in the difference of two large numbers.
TEST(Comparators, TheShortestIntervalChangesNothing) {
  for (const double duration_s : {1e-12, 1e-17, 1e-21}) {
    const Comparators comparators = made(fixed_at(0.0, 20e-6));
    for (const double middle_v : {11.3, std::nextafter(11.3, 0.0), std::nextafter(11.3, 20.0)}) {
      ComparatorMemory m{.filtered_v = {5.0, 0.0, 0.0}, .levels = 1};
      comparators.follow(
          m, 0, 0.0, duration_s,
          {.start_v = {11.3, 0.0, 0.0}, .middle_v = {middle_v, 0.0, 0.0}, .end_v = {11.3, 0.0, 0.0}});
      EXPECT_NEAR(m.filtered_v.a, 5.0 + 6.3 * duration_s / 20e-6, 1e-14) << duration_s;
      EXPECT_EQ(m.edges[0], 0u);
    }
  }
}

// Up and down again within one interval is two edges, with an RC and without: the lengths of intervals are
// not those of pulses. Catches: a search that compares the ends of an interval only; the first edge in place
// of the last; a turning point that is missed.
TEST(Comparators, TwoCrossingsWithinOneIntervalAreTwoEdges) {
  const double middle_s = 0.5 * kPeriod_s;
  const auto hill = [&](double t) {
    const double x = (t - middle_s) / middle_s;
    return 1.0 - x * x;
  };
  const double away_s = middle_s * std::sqrt(1.0 - 0.9);
  const ComparatorMemory m = followed(made(fixed_at(0.9)), hill, kWhole);
  EXPECT_EQ(m.edges[0], 2u);
  EXPECT_EQ(m.levels, 0u);
  EXPECT_NEAR(m.edge_s[0], middle_s + middle_s * std::sqrt(1.0 - 0.89), 1e-15);
  EXPECT_GT(m.edge_s[0], middle_s + away_s) << "half of the hysteresis below";
  // Behind the RC the hill comes later; cut into small intervals it is the same hill.
  std::vector<double> fine;
  for (int n = 1; n <= 1000; ++n)
    fine.push_back(n / 1000.0);
  const Comparators filtered = made(fixed_at(0.9, kRc_s));
  const ComparatorMemory whole = followed(filtered, hill, kWhole, filtered.settled(0.0));
  const ComparatorMemory parts = followed(filtered, hill, fine, filtered.settled(0.0));
  EXPECT_EQ(whole.edges[0], 2u);
  EXPECT_EQ(parts.edges[0], 2u);
  EXPECT_NEAR(whole.edge_s[0], parts.edge_s[0], 1e-15);
  EXPECT_GT(whole.edge_s[0], m.edge_s[0]);
  // With a charge from before: down with its decay, up with the hill, and down again.
  const ComparatorMemory charged{.filtered_v = {5.0, 0.0, 0.0}, .levels = 1};
  const Comparators slow = made(fixed_at(0.6, kRc_s));
  const ComparatorMemory three = followed(slow, hill, kWhole, charged);
  const ComparatorMemory again = followed(slow, hill, fine, charged);
  EXPECT_EQ(three.edges[0], 3u);
  EXPECT_EQ(again.edges[0], 3u);
  EXPECT_NEAR(three.edge_s[0], again.edge_s[0], 1e-15);
}

// Catches: a comparator without memory, a threshold on the wrong side, offsets of another terminal.
TEST(Comparators, WithinTheHysteresisNothingChanges) {
  const auto swing = [](double v) { return [v](double t) { return v * std::cos(2.0 * t / kPeriod_s); }; };
  ComparatorParameters p = fixed_at(0.0, 0.0, 2.0);
  ComparatorMemory m = followed(made(p), swing(0.999), kWhole);
  EXPECT_EQ(m.edges[0], 0u);
  m = followed(made(p), swing(1.001), kParts, m);
  EXPECT_EQ(m.edges[0], 1u);  // a jump to 1.001 at the start
  EXPECT_EQ(m.edge_s[0], 0.0);
  EXPECT_EQ(m.levels, 1u);
  m = followed(made(p), swing(0.5), kWhole, m, 1);
  EXPECT_EQ(m.edges[0], 1u) << "it stays high until -1";
  p.offset_a_v = -1.1;
  p.offset_b_v = 1.1;
  m = followed(made(p), swing(0.0), kWhole, m, 2);
  EXPECT_EQ(m.levels, 2u);
  EXPECT_EQ(m.edge_tick, (std::array<Tick, 3>{2, 2, 0}));
  Sample s;
  made(p).read(m, 5, s);
  EXPECT_EQ(s.comparator_levels, 2u);
  EXPECT_EQ(s.comparator_a_edges, 2u);
  EXPECT_EQ(s.comparator_b_edges, 1u);
  EXPECT_DOUBLE_EQ(s.comparator_a_age_s, 3 * kPeriod_s);
  EXPECT_DOUBLE_EQ(s.comparator_c_age_s, 5 * kPeriod_s) << "none: since tick 0";
}

// The virtual neutral is the mean of all three, the half link that of the drive. Catches: a mean over the
// other two, a reference without the RC of the terminal.
TEST(Comparators, AReferenceIsTheMeanOfTheTerminalsOrHalfTheLink) {
  const TerminalPath path{
      .start_v = {7.0, 1.0, 1.0}, .middle_v = {7.0, 1.0, 1.0}, .end_v = {7.0, 1.0, 1.0}, .link_v = 12.0};
  for (const double rc_s : {0.0, 1e-9}) {
    ComparatorParameters p = fixed_at(0.0, rc_s);
    p.reference = ComparatorReference::kVirtualNeutral;
    ComparatorMemory m;
    made(p).follow(m, 0, 0.0, kPeriod_s, path);
    EXPECT_EQ(m.levels, 1u);
    EXPECT_NEAR(m.filtered_v.a, 4.0, 1e-12);
    EXPECT_NEAR(m.filtered_v.b, -2.0, 1e-12);
    p.reference = ComparatorReference::kHalfLink;
    m = {};
    made(p).follow(m, 0, 0.0, kPeriod_s, path);
    EXPECT_EQ(m.levels, 1u);
    EXPECT_NEAR(m.filtered_v.a, 1.0, 1e-12);
    EXPECT_NEAR(m.filtered_v.c, -5.0, 1e-12);
  }
  EXPECT_EQ(made(fixed_at(4.0)).settled(12.0).levels, 7u);
  EXPECT_EQ(made(fixed_at(4.0)).settled(12.0).filtered_v.b, 2.0);
}

// Catches: noise that depends on how a tick is cut, on nothing, or on what the others do; a bound that leaves
// edges out.
TEST(Comparators, NoiseIsAFunctionOfSeedAndTimeAlone) {
  ComparatorParameters p = fixed_at(0.0);
  p.noise_rms_v = 0.1;
  const auto zero = [](double) { return 0.0; };
  const auto run = [&](const std::vector<double>& ends, std::uint64_t seed, double v) {
    ComparatorMemory m;
    for (Tick tick = 0; tick < 200; ++tick)
      m = followed(
          made(p, seed), [v](double) { return v; }, ends, m, tick);
    return m;
  };
  const ComparatorMemory whole = run(kWhole, 1, 0.0);
  const ComparatorMemory parts = run(kParts, 1, 0.0);
  // 10,000 values, each switches with the probability of the other side: about half of them.
  EXPECT_NEAR(static_cast<double>(whole.edges[0]), 0.46 * 10'000, 300.0);
  EXPECT_EQ(whole.edges, parts.edges);
  EXPECT_EQ(whole.edge_tick, parts.edge_tick);
  EXPECT_NEAR(whole.edge_s[0], parts.edge_s[0], 1e-15);
  // At -2 sigma the level rises with 1.8 % of the values and falls with the next: of 2,000 ticks some 40 end
  // high.
  ComparatorMemory low;
  int ends_high = 0;
  for (Tick tick = 0; tick < 2000; ++tick) {
    low = followed(
        made(p), [](double) { return -0.2; }, kWhole, low, tick);
    ends_high += static_cast<int>(low.levels & 1U);
  }
  EXPECT_NEAR(ends_high, 40, 25);
  EXPECT_NE(whole.edges[0], whole.edges[1]);
  EXPECT_NE(whole.edges[0], run(kWhole, 2, 0.0).edges[0]);
  EXPECT_EQ(run(kWhole, 1, 1.0).edges[0], 1u) << "ten times the noise away";
  EXPECT_EQ(followed(made(p), zero, kWhole).edge_tick[0], 0);
}

// ---- on motors ----

constexpr PmMachineParameters kHobby{.pole_pairs = 7,
                                     .stator_resistance_ohm = 0.1,
                                     .inductance_d_h = 40e-6,
                                     .inductance_q_h = 40e-6,
                                     .torque_constant_nm_per_a = 0.0129,
                                     .star = true};

AxisParameters pm_axis(double speed_rad_s) {
  AxisParameters p;
  p.machine = kHobby;
  p.mechanics = {.inertia_kgm2 = 1e-5};
  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = speed_rad_s;
  p.drive = plain_drive(DriveKind::kSwitched);
  p.drive.amplifier.voltage_limit_v = 12.0;
  p.drive.amplifier.over_current_a = 1000.0;
  p.sensors.comparator = {.enabled = true, .hysteresis_v = 0.02};
  return p;
}

struct Seen {
  double time_s;
  double angle_rad;  ///< of the rotor then, at a constant speed
  std::uint64_t level;
};

/// The edges of the comparator of phase a under a command.
std::vector<Seen> edges_of(const AxisParameters& p, int substeps, Tick ticks, const PhaseCommand& command,
                           double period_s = kPeriod_s) {
  Axis axis(p, {.period_s = period_s, .substeps = substeps}, 1, 0);
  std::vector<Seen> edges;
  std::uint64_t count = 0;
  for (Tick tick = 0; tick < ticks; ++tick) {
    axis.advance(command, tick);
    const Sample s = axis.sample(tick + 1);
    if (tick > 0) {  // in the first tick the rotor comes to its speed
      EXPECT_LE(s.comparator_a_edges - count, 1u);
    }
    if (s.comparator_a_edges != count) {
      edges.push_back({static_cast<double>(tick + 1) * period_s - s.comparator_a_age_s,
                       s.angle_rad - s.speed_rad_s * s.comparator_a_age_s, s.comparator_levels & 1u});
    }
    count = s.comparator_a_edges;
  }
  return edges;
}

// With all legs off the terminals are the sines of the emf: -E sin(n_p w t), of which an RC makes one that
// lags by atan(n_p w RC) and is shorter; half of the hysteresis is asin(h/(2 E')) more. The parabola of a
// substep errs by (n_p w h)^3/124 of the amplitude: 0.6 ns here at most. Catches: an edge at the tick or
// substep, a straight line (which errs by 90 ns), a filter that lags by another angle.
TEST(Comparators, TheEmfOfAFreeMotorCrossesByItsAngle) {
  constexpr double kSpeed_rad_s = 300.0;
  constexpr double kElectrical_rad_s = 7.0 * kSpeed_rad_s;
  AxisParameters p = pm_axis(kSpeed_rad_s);
  for (const double rc_s : {0.0, 20e-6}) {
    p.sensors.comparator.rc_s = rc_s;
    const std::vector<Seen> edges = edges_of(p, 2, 400, {.gates = Gates::kOff});
    ASSERT_GE(edges.size(), 12u);
    const double lag_rad = std::atan(kElectrical_rad_s * rc_s);
    const double peak_v =
        std::sqrt(2.0 / 3.0) * kHobby.torque_constant_nm_per_a * kSpeed_rad_s * std::cos(lag_rad);
    for (std::size_t n = 3; n < edges.size(); ++n) {  // the start of the RC has died away
      const double angle_rad = 7.0 * edges[n].angle_rad - lag_rad - std::asin(0.01 / peak_v);
      const double half_turns = angle_rad / std::numbers::pi;
      EXPECT_NEAR(half_turns, std::round(half_turns), 1e-9 * kElectrical_rad_s / std::numbers::pi) << n;
      // Rising where -sin does: at odd half turns.
      EXPECT_EQ(edges[n].level, static_cast<std::uint64_t>(std::llround(half_turns)) % 2) << n;
    }
  }
}

// Two legs drive the star by PWM and the third floats, at speed: its edges are those of a tick with sixteen
// times as many substeps, to 1 ns. Catches: a floating terminal that goes straight between commutations, a
// diode that is left out, an RC that forgets the pulses.
TEST(Comparators, AFloatingPhaseUnderPwmCrossesAsInATightReference) {
  AxisParameters p = pm_axis(250.0);
  p.drive.inverter.dead_time_s = 300e-9;
  p.sensors.comparator.rc_s = 0.5e-6;
  p.sensors.comparator.hysteresis_v = 0.05;
  const PhaseCommand command{
      .gates = Gates::kDuty, .legs_off = 1, .setpoint = {.a = 0.0, .b = 0.7, .c = 0.0}};
  const std::vector<Seen> edges = edges_of(p, 4, 300, command);
  const std::vector<Seen> reference = edges_of(p, 64, 300, command);
  ASSERT_GE(edges.size(), 8u);
  ASSERT_EQ(edges.size(), reference.size());
  for (std::size_t n = 0; n < edges.size(); ++n) {
    EXPECT_NEAR(edges[n].time_s, reference[n].time_s, 1e-9) << n;
    EXPECT_EQ(edges[n].level, reference[n].level);
  }
}

// The trapezoid of the book's motor goes through zero in a straight line: 30 degrees wide, in the middle of
// it. Catches: corners of the emf that are not ends of pieces.
TEST(Comparators, ATrapezoidCrossesInTheMiddleOfItsFlank) {
  AxisParameters p = pm_axis(10.0);
  p.machine = bldc_motor::kMotor;
  p.sensors.comparator.hysteresis_v = 1e-6;
  const std::vector<Seen> edges = edges_of(p, 2, 2000, {.gates = Gates::kOff}, 1e-3);
  ASSERT_GE(edges.size(), 5u);
  for (const Seen& edge : edges) {
    if (edge.time_s < 0.1) continue;  // at rest the emf begins within its flank
    const double half_turns = edge.angle_rad / std::numbers::pi;
    EXPECT_NEAR(half_turns, std::round(half_turns), 3e-8) << "half of the hysteresis is 2.44e-8";
  }
}

// Catches: comparators that act without being configured, or that change what the motor does.
TEST(Comparators, TheMotorDoesNotFeelThem) {
  AxisParameters p = pm_axis(0.0);
  p.mechanics.motion = ShaftMotion::kFree;
  p.sensors.comparator.noise_rms_v = 0.1;
  AxisParameters plain = p;
  plain.sensors.comparator = {};
  Axis with(p, {.period_s = kPeriod_s, .substeps = 2}, 1, 0);
  Axis without(plain, {.period_s = kPeriod_s, .substeps = 2}, 1, 0);
  for (Tick tick = 0; tick < 500; ++tick) {
    const double angle = 0.02 * static_cast<double>(tick);
    const PhaseCommand command{
        .gates = Gates::kDuty,
        .legs_off = static_cast<std::uint32_t>(tick / 50 % 2),
        .setpoint = {.a = 0.5 + 0.1 * std::cos(angle), .b = 0.5 + 0.1 * std::sin(angle), .c = 0.5}};
    with.advance(command, tick);
    without.advance(command, tick);
    Sample seen = with.sample(tick + 1);
    const Sample plain_seen = without.sample(tick + 1);
    EXPECT_NEAR(seen.true_i_a_a, plain_seen.true_i_a_a, 1e-9);
    EXPECT_NEAR(seen.angle_rad, plain_seen.angle_rad, 1e-9);
    EXPECT_EQ(plain_seen.comparator_a_age_s, 0.0);
    EXPECT_EQ(plain_seen.comparator_a_edges, 0u);
    EXPECT_EQ(plain_seen.comparator_a_v, 0.0);
  }
  EXPECT_GT(with.sample(500).comparator_a_edges, 100u);
}

// Catches: comparators of a machine or drive that has no terminals of this kind; noise without hysteresis,
// whose edges have no end.
TEST(Comparators, TheRulesNameTheFieldAndTheReason) {
  const auto rule = [](const AxisParameters& p, std::string_view field) {
    for (const Problem& each : problems(p))
      if (each.field == field) return each.rule;
    return std::string();
  };
  AxisParameters p = pm_axis(0.0);
  EXPECT_EQ(rule(p, "comparator.enabled") + rule(p, "comparator.hysteresis_v"), "");
  p.sensors.comparator.hysteresis_v = 0.0;
  EXPECT_EQ(rule(p, "comparator.hysteresis_v"), "is 0 V but must be above 0 while comparator.enabled is 1");
  PmMachineParameters two_phase = kHobby;
  two_phase.star = false;
  p.machine = two_phase;
  EXPECT_EQ(rule(p, "comparator.enabled"), "is 1 but needs a machine with three phases in a star");
  p = pm_axis(0.0);
  p.drive.kind = DriveKind::kSource;
  EXPECT_EQ(rule(p, "comparator.enabled"),
            "is 1 but must be 0 with drive.kind = \"source\", which has no rails");
}

}  // namespace
}  // namespace drivebench::comparators_test
