#include "plant/machines/saturated_induction/saturated_induction_machine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "plant/machines/induction/induction_machine.hpp"
#include "plant/math/rk4.hpp"
#include "plant/parameters/machine_kind.hpp"

namespace drivebench::saturated_induction_machine_test {
namespace {

/// The servo motor of the book (IM-04) with a magnetising curve that bends.
SaturatedInductionMachineParameters saturating() {
  return {.pole_pairs = 3,
          .stator_resistance_ohm = 1.7,
          .rotor_resistance_ohm = 3.9,
          .stator_leakage_h = 0.0023,
          .rotor_leakage_h = 0.0029,
          .magnetising_curve = Curve({{0.0, 0.0}, {3.0, 0.0351}, {6.0, 0.055}, {12.0, 0.075}, {30.0, 0.1}})};
}

/// The same machine with a straight curve, in both forms.
SaturatedInductionMachineParameters straight() {
  SaturatedInductionMachineParameters p = saturating();
  p.magnetising_curve = Curve({{0.0, 0.0}, {1.0, 0.0117}, {5.0, 0.0585}});
  return p;
}
constexpr InductionMachineParameters kLinear{.pole_pairs = 3,
                                             .stator_resistance_ohm = 1.7,
                                             .rotor_resistance_ohm = 3.9,
                                             .stator_inductance_h = 0.0140,
                                             .rotor_inductance_h = 0.0146,
                                             .mutual_inductance_h = 0.0117};

RotorMotion motion(double speed_rad_s) {
  return {.angle_rad = 0.0, .speed_rad_s = speed_rad_s, .electrical = {1.0, 0.0}};
}

double dot(TwoPhase x, TwoPhase y) {
  return x.a * y.a + x.b * y.b;
}
double length(TwoPhase x) {
  return std::sqrt(dot(x, x));
}
TwoPhase difference(TwoPhase x, TwoPhase y) {
  return {x.a - y.a, x.b - y.b};
}

TwoPhase stator_a(const SaturatedInductionMachineConstants& c, const SaturatedInductionMachineState& x) {
  return winding_currents(c, x, motion(0.0)).stator;
}
TwoPhase magnetising_wb(const SaturatedInductionMachineConstants& c,
                        const SaturatedInductionMachineState& x) {
  const TwoPhase i = stator_a(c, x);
  return {x.stator_a_wb - c.stator_leakage_h * i.a, x.stator_b_wb - c.stator_leakage_h * i.b};
}

struct Random {
  std::mt19937_64 engine;
  double operator()(double size) { return std::uniform_real_distribution<double>(-size, size)(engine); }
  TwoPhase two(double size) { return {(*this)(size), (*this)(size)}; }
  SaturatedInductionMachineState state() {
    return {(*this)(0.15), (*this)(0.15), (*this)(0.15), (*this)(0.15)};
  }
  TwoPhase direction() {
    const double angle_rad = (*this)(std::numbers::pi);
    return {std::cos(angle_rad), std::sin(angle_rad)};
  }
};

TerminalInput blocked_input(int n, Random& random) {
  TerminalInput u{.voltage_v = random.two(80.0)};
  if (n % 3 == 1) {
    u.conduction = Conduction::kLine;
    u.line = random.direction();
  } else if (n % 3 == 2) {
    u.conduction = Conduction::kNone;
  }
  return u;
}

// The law itself: flux along the sum of the currents, as long as the curve says. Catches: an inverse of the
// wrong leakages, a flux along the stator current, a chord taken for a slope.
TEST(SaturatedInductionMachine, MagnetisingFluxAndCurrentLieOnTheCurveInOneDirection) {
  const SaturatedInductionMachineParameters p = saturating();
  const SaturatedInductionMachineConstants c = constants_of(p);
  Random random{std::mt19937_64(31)};
  for (int n = 0; n < 10'000; ++n) {
    const SaturatedInductionMachineState x = random.state();
    const TwoPhase i_s = stator_a(c, x);
    const TwoPhase flux_wb = magnetising_wb(c, x);
    const TwoPhase i_m{i_s.a + (x.rotor_a_wb - flux_wb.a) / p.rotor_leakage_h,
                       i_s.b + (x.rotor_b_wb - flux_wb.b) / p.rotor_leakage_h};
    // Differences of fluxes over a leakage of 2 mH: 1e-16 Wb are 1e-13 A.
    ASSERT_NEAR(length(flux_wb), p.magnetising_curve.value(length(i_m)), 1e-13);
    ASSERT_NEAR(flux_wb.a * i_m.b, flux_wb.b * i_m.a, 1e-12);
    ASSERT_GE(dot(flux_wb, i_m), 0.0);
  }
}

int segment(const Curve& curve, double flux_wb) {
  int n = 0;
  for (const CurvePoint& point : curve.points())
    n += point.y < flux_wb ? 1 : 0;
  return n;
}

// Catches: any wrong sign or factor, an energy that is not that of the curve, a constraint that does work.
TEST(SaturatedInductionMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  const SaturatedInductionMachineParameters p = saturating();
  const SaturatedInductionMachineConstants c = constants_of(p);
  Random random{std::mt19937_64(32)};
  int judged = 0;
  for (int n = 0; n < 12'000; ++n) {
    const TerminalInput u = blocked_input(n, random);
    const RotorMotion now = motion(random(900.0));
    const SaturatedInductionMachineState x = restricted(c, random.state(), now, u);
    const SaturatedInductionMachineState slope = derivative(c, x, now, u);
    // Within a segment of the curve the energy is smooth: fourth-order differences are good to 1e-11.
    constexpr double kStep_s = 2e-7;
    const auto at = [&](int steps) { return advanced(x, steps * kStep_s, slope); };
    if (segment(p.magnetising_curve, length(magnetising_wb(c, at(-2)))) !=
        segment(p.magnetising_curve, length(magnetising_wb(c, at(2))))) {
      continue;
    }
    const auto energy_j = [&](int steps) { return stored_energy_j(c, at(steps), now); };
    const double storing_w =
        (8.0 * (energy_j(1) - energy_j(-1)) - (energy_j(2) - energy_j(-2))) / (12.0 * kStep_s);
    const double in_w = dot(u.voltage_v, stator_a(c, x));
    const double shaft_w = torque_nm(c, x, now) * now.speed_rad_s;
    const double flowing_w = std::abs(in_w) + losses_w(c, x, now) + std::abs(shaft_w) + std::abs(storing_w);
    ASSERT_NEAR(in_w, storing_w + losses_w(c, x, now) + shaft_w, 1e-9 * flowing_w) << n;
    ++judged;
  }
  EXPECT_GT(judged, 11'500);
}

struct Pair {
  SaturatedInductionMachineState saturated;
  InductionMachineState linear;
  double speed_rad_s;
};

// A line start with a spell of an open phase and one of open terminals, both models turned by the linear one.
// Catches: leakages or resistances of the wrong side, a constraint solved with the wrong inductance.
TEST(SaturatedInductionMachine, AStraightCurveMakesItTheLinearMachine) {
  const SaturatedInductionMachineConstants c = constants_of(straight());
  const InductionMachineConstants linear = constants_of(kLinear);
  constexpr double kStep_s = 20e-6;
  Pair x{};
  for (int n = 0; n < 10'000; ++n) {
    const double phase = 377.0 * kStep_s * n;
    TerminalInput u{.voltage_v = {60.0 * std::cos(phase), 60.0 * std::sin(phase)}};
    if (n >= 4'000 && n < 6'000) u.conduction = Conduction::kLine;
    if (n >= 6'000 && n < 7'000) u.conduction = Conduction::kNone;
    u.line = {.a = 0.6, .b = 0.8};
    if (n == 4'000 || n == 6'000) {
      x.saturated = restricted(c, x.saturated, motion(x.speed_rad_s), u);
      x.linear = restricted(linear, x.linear, motion(x.speed_rad_s), u);
    }
    x = rk4_step(x, kStep_s, [&](const Pair& s) noexcept -> Pair {
      const RotorMotion now = motion(s.speed_rad_s);
      return {derivative(c, s.saturated, now, u), derivative(linear, s.linear, now, u),
              torque_nm(linear, s.linear, now) / 1.1e-4};
    });
    const RotorMotion now = motion(x.speed_rad_s);
    const TwoPhase i = stator_a(c, x.saturated);
    ASSERT_NEAR(i.a, x.linear.i_a_a, 1e-9) << n;
    ASSERT_NEAR(i.b, x.linear.i_b_a, 1e-9) << n;
    ASSERT_NEAR(torque_nm(c, x.saturated, now), torque_nm(linear, x.linear, now), 1e-10);
    ASSERT_NEAR(losses_w(c, x.saturated, now), losses_w(linear, x.linear, now), 1e-7);
    ASSERT_NEAR(stored_energy_j(c, x.saturated, now), stored_energy_j(linear, x.linear, now), 1e-10);
    ASSERT_NEAR(rotor_flux_wb(c, x.saturated, now).a, x.linear.psi_a_wb, 1e-11);
    const TwoPhase open_v = open_circuit_voltages(c, x.saturated, now).stator;
    const TwoPhase linear_v = open_circuit_voltages(linear, x.linear, now).stator;
    const bool open = u.conduction == Conduction::kNone;
    ASSERT_NEAR(open ? length(difference(open_v, linear_v)) : 0.0, 0.0, 1e-7);
  }
  EXPECT_GT(x.speed_rad_s, 50.0);
}

/// Slope of the stator current, by differences along the slope of the fluxes.
TwoPhase current_slope(const SaturatedInductionMachineConstants& c, const SaturatedInductionMachineState& x,
                       const SaturatedInductionMachineState& slope) {
  constexpr double kStep_s = 1e-7;
  const TwoPhase from = stator_a(c, advanced(x, -kStep_s, slope));
  const TwoPhase to = stator_a(c, advanced(x, kStep_s, slope));
  return {(to.a - from.a) / (2.0 * kStep_s), (to.b - from.b) / (2.0 * kStep_s)};
}

// The constraint in the bent part of the curve. Catches: a slope of the flux taken as its chord, a cross term
// between the conducting and the open direction that is left out.
TEST(SaturatedInductionMachine, AnOpenDirectionKeepsItsCurrentAndTheOtherObeysItsVoltage) {
  const SaturatedInductionMachineParameters p = saturating();
  const SaturatedInductionMachineConstants c = constants_of(p);
  Random random{std::mt19937_64(33)};
  int judged = 0;
  for (int n = 0; n < 3'000; ++n) {
    const TerminalInput u = blocked_input(n, random);
    if (u.conduction == Conduction::kFull) continue;
    const RotorMotion now = motion(random(500.0));
    const SaturatedInductionMachineState before = random.state();
    const SaturatedInductionMachineState x = restricted(c, before, now, u);
    const TwoPhase wanted_a = conducted(stator_a(c, before), u);
    ASSERT_NEAR(length(difference(stator_a(c, x), wanted_a)), 0.0, 1e-12);
    ASSERT_EQ(x.rotor_a_wb, before.rotor_a_wb);
    ASSERT_EQ(x.rotor_b_wb, before.rotor_b_wb);
    const SaturatedInductionMachineState slope = derivative(c, x, now, u);
    if (segment(p.magnetising_curve, length(magnetising_wb(c, advanced(x, -1e-7, slope)))) !=
        segment(p.magnetising_curve, length(magnetising_wb(c, advanced(x, 1e-7, slope))))) {
      continue;
    }
    const TwoPhase rate = current_slope(c, x, slope);
    // Of slopes up to 1e5 A/s; the error of the differences is 1e-3 A/s.
    ASSERT_NEAR(length(difference(rate, conducted(rate, u))), 0.0, 1e-2) << n;
    if (u.conduction == Conduction::kLine) {
      ASSERT_NEAR(dot(u.line, {slope.stator_a_wb, slope.stator_b_wb}),
                  dot(u.line, u.voltage_v) - 1.7 * dot(u.line, wanted_a), 1e-9);
    }
    ++judged;
  }
  EXPECT_GT(judged, 1'950);
}

// Currents that cancel leave no flux whose direction one could ask for. Catches: an inductance of zero there.
TEST(SaturatedInductionMachine, AnOpenDirectionKeepsItsCurrentWhereNoFluxMagnetises) {
  SaturatedInductionMachineParameters p = saturating();
  p.stator_leakage_h = 1.0 / 512.0;  // powers of two cancel exactly
  p.rotor_leakage_h = 1.0 / 256.0;
  const SaturatedInductionMachineConstants c = constants_of(p);
  const SaturatedInductionMachineState x{.stator_a_wb = 2.0 / 512.0, .rotor_a_wb = -2.0 / 256.0};
  ASSERT_EQ(length(magnetising_wb(c, x)), 0.0);
  const SaturatedInductionMachineState slope =
      derivative(c, x, motion(100.0), {.conduction = Conduction::kLine, .line = {1.0, 0.0}});
  EXPECT_LT(slope.stator_b_wb, -1.0);
  EXPECT_NEAR(current_slope(c, x, slope).b, 0.0, 1e-3);
}

// Catches: an open-circuit voltage of the wrong sign or of the unsaturated machine.
TEST(SaturatedInductionMachine, TheOpenCircuitVoltageKeepsTheCurrentAtZero) {
  const SaturatedInductionMachineConstants c = constants_of(saturating());
  const RotorMotion now = motion(150.0);
  const SaturatedInductionMachineState x =
      restricted(c, {.rotor_a_wb = 0.06, .rotor_b_wb = -0.05}, now, {.conduction = Conduction::kNone});
  EXPECT_NEAR(length(stator_a(c, x)), 0.0, 1e-13);
  const TwoPhase open_v = open_circuit_voltages(c, x, now).stator;
  EXPECT_GT(length(open_v), 10.0);
  EXPECT_NEAR(length(current_slope(c, x, derivative(c, x, now, {.voltage_v = open_v}))), 0.0, 1e-3);
}

// Conventions: a positive voltage gives a positive current at standstill, and a stator flux ahead of the
// rotor flux (from a to b) a positive torque. A machine without flux has no direction: nothing may become
// NaN.
TEST(SaturatedInductionMachine, ItStartsFromNoFluxAndPositiveVoltageDrivesPositiveCurrent) {
  const SaturatedInductionMachineConstants c = constants_of(saturating());
  for (const Conduction conduction : {Conduction::kFull, Conduction::kLine, Conduction::kNone}) {
    const TerminalInput u{.voltage_v = {10.0, 20.0}, .conduction = conduction, .line = {0.0, 1.0}};
    const SaturatedInductionMachineState slope = derivative(c, {}, motion(10.0), u);
    EXPECT_EQ(slope.stator_a_wb, conduction == Conduction::kFull ? 10.0 : 0.0);
    EXPECT_EQ(slope.stator_b_wb, conduction == Conduction::kNone ? 0.0 : 20.0);
    const SaturatedInductionMachineState rest = restricted(c, {}, motion(0.0), u);
    EXPECT_EQ(stored_energy_j(c, rest, motion(0.0)), 0.0);
    EXPECT_EQ(torque_nm(c, rest, motion(0.0)), 0.0);
  }
  const SaturatedInductionMachineState x =
      rk4_step(SaturatedInductionMachineState{}, 1e-5, [&](const SaturatedInductionMachineState& s) noexcept {
        return derivative(c, s, motion(0.0), {.voltage_v = {10.0, 20.0}});
      });
  EXPECT_GT(stator_a(c, x).a, 0.0);
  EXPECT_GT(stator_a(c, x).b, stator_a(c, x).a);
  EXPECT_GT(torque_nm(c, {.stator_b_wb = 0.05, .rotor_a_wb = 0.05}, motion(0.0)), 0.0);
}

// At synchronous speed the rotor carries nothing and the stator all of the magnetising current, so the
// terminal voltage follows from a point of the curve. Catches: a curve that is read along the wrong axis.
TEST(SaturatedInductionMachine, NoLoadCurrentFollowsTheCurve) {
  const SaturatedInductionMachineParameters p = saturating();
  const SaturatedInductionMachineConstants c = constants_of(p);
  constexpr double kLine_rad_s = 377.0;
  constexpr double kStep_s = 20e-6;
  for (const double current_a : {2.0, 5.0, 9.0, 20.0, 40.0}) {
    const double flux_wb = p.magnetising_curve.value(current_a) + p.stator_leakage_h * current_a;
    const double peak_v = length({1.7 * current_a, kLine_rad_s * flux_wb});
    SaturatedInductionMachineState x;
    for (int n = 0; n < 10'000; ++n) {
      const auto u = [&](double part) -> TerminalInput {
        const double phase = kLine_rad_s * kStep_s * (n + part);
        return {.voltage_v = {peak_v * std::cos(phase), peak_v * std::sin(phase)}};
      };
      const std::array<TerminalInput, 3> points{u(0.0), u(0.5), u(1.0)};
      x = rk4_step(x, kStep_s, [&](const SaturatedInductionMachineState& s, StepPoint point) noexcept {
        return derivative(c, s, motion(kLine_rad_s / 3.0), points[static_cast<std::size_t>(point)]);
      });
    }
    // 0.2 s are 25 time constants of the slowest part; the rest is RK4.
    EXPECT_NEAR(length(stator_a(c, x)), current_a, 1e-6 * current_a);
    EXPECT_NEAR(torque_nm(c, x, motion(0.0)), 0.0, 1e-6);
  }
}

// Catches: a factor that reaches the wrong parameter, a time constant that forgets saturation.
TEST(SaturatedInductionMachine, AdjustmentsTimeConstantAndConnectionFollowTheParameters) {
  SaturatedInductionMachineParameters p = adjusted(saturating(), {.stator_resistance_factor = 2.0,
                                                                  .rotor_resistance_factor = 3.0,
                                                                  .magnet_factor = 0.1,
                                                                  .series_resistance_ohm = 0.1,
                                                                  .series_inductance_h = 1e-3});
  EXPECT_DOUBLE_EQ(p.stator_resistance_ohm, 3.5);
  EXPECT_DOUBLE_EQ(p.rotor_resistance_ohm, 11.7);
  EXPECT_DOUBLE_EQ(p.stator_leakage_h, 0.0033);
  EXPECT_EQ(p.magnetising_curve.points(), saturating().magnetising_curve.points());
  EXPECT_EQ(connection_of(p), Connection::kTwoPhase);
  p.star = true;
  EXPECT_EQ(connection_of(p), Connection::kStar);
  EXPECT_EQ(pole_pairs_of(p), 0.0);
  // Saturated for good (0.1 - 0.075 Wb in 18 A) it is fastest, with any resistances.
  const auto linear_s = [](const SaturatedInductionMachineParameters& q, double m) {
    return fastest_time_constant_s(
        InductionMachineParameters{.stator_resistance_ohm = q.stator_resistance_ohm,
                                   .rotor_resistance_ohm = q.rotor_resistance_ohm,
                                   .stator_inductance_h = q.stator_leakage_h + m,
                                   .rotor_inductance_h = q.rotor_leakage_h + m,
                                   .mutual_inductance_h = m});
  };
  for (const double stator_ohm : {0.01, 1.7, 20.0}) {
    p = saturating();
    p.stator_resistance_ohm = stator_ohm;
    EXPECT_NEAR(fastest_time_constant_s(p), linear_s(p, 0.025 / 18.0), 1e-12);
    EXPECT_LT(fastest_time_constant_s(p), linear_s(p, 0.0117));
  }
}

// Catches: a curve that would be read below its first point.
TEST(SaturatedInductionMachine, TheCurveMustBeginAtTheOriginAndRise) {
  const auto rule = [](Curve curve) {
    SaturatedInductionMachineParameters p = saturating();
    p.magnetising_curve = std::move(curve);
    std::vector<Problem> found;
    Problems rules(found);
    add_problems(p, rules);
    for (const Problem& problem : found)
      EXPECT_EQ(problem.field, "machine.magnetising_curve");
    return found.empty() ? std::string() : found.front().rule;
  };
  EXPECT_EQ(rule(saturating().magnetising_curve), "");
  EXPECT_EQ(rule({}), "has no points but needs two or more");
  EXPECT_EQ(rule(Curve({{-1.0, -0.5}, {1.0, 0.5}})), "begins at [-1, -0.5] but must begin at [0, 0]");
  const CurveParameter& row = SaturatedInductionMachine::kind().curves.front();
  AxisParameters axis;
  axis.machine = saturating();
  row.set(axis, Curve({{0.0, 0.0}, {2.0, 1.0}}));
  EXPECT_EQ(row.get(axis).points().back().y, 1.0);
  row.set(axis, Curve({{0.0, 0.0}, {1.0, 0.0}}));
  const std::vector<Problem> found = problems(axis);
  EXPECT_TRUE(std::any_of(found.begin(), found.end(), [](const Problem& problem) {
    return problem.field == "machine.magnetising_curve" &&
           problem.rule == "point 2 must have a larger y than the one before";
  }));
}

}  // namespace
}  // namespace drivebench::saturated_induction_machine_test
