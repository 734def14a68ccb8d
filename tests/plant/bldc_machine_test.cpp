#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "plant/machines/pm/pm_machine.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "tests/plant/bldc_motor.hpp"
#include "tests/plant/power_balance.hpp"

namespace drivebench::bldc_machine_test {
namespace {

using namespace bldc_motor;

/// The phase currents of the book's commutation table (BL-03) over the electrical angle, in units of I_p.
Phases commutated(double electrical_rad) {
  constexpr std::array<Phases, 6> kTable{
      {{0, 1, -1}, {-1, 1, 0}, {-1, 0, 1}, {0, -1, 1}, {1, -1, 0}, {1, 0, -1}}};
  const double degrees = electrical_rad / kDegree;
  return kTable[static_cast<std::size_t>(std::floor((degrees + 30.0) / 60.0)) % 6];
}

// BL-02, against the printed cases, within a turn and beyond. Catches: a wrong corner, slope, phase order,
// n_p.
TEST(BldcMachine, TheBackEmfIsTheTrapezoidOfTheBook) {
  for (const int pole_pairs : {1, 4}) {
    BldcMachineParameters p = kMotor;
    p.pole_pairs = pole_pairs;
    const BldcMachineConstants c = constants_of(p);
    for (double angle_rad = -0.3; angle_rad < 6.7; angle_rad += 0.00137) {
      const ThreePhase e = back_emf_shape(c, angle_rad);
      ASSERT_NEAR(e.a, book_shape(pole_pairs * angle_rad), 1e-12) << angle_rad;
      ASSERT_NEAR(e.b, book_shape(pole_pairs * angle_rad - 2.0 * kPi / 3.0), 1e-12) << angle_rad;
      ASSERT_NEAR(e.c, book_shape(pole_pairs * angle_rad + 2.0 * kPi / 3.0), 1e-12) << angle_rad;
    }
  }
}

// AC-27, BL-02. The midpoint rule over 3600 parts of a turn, whose ends meet the corners, is good to 1e-6.
// Catches: a trapezoid of another width.
TEST(BldcMachine, RmsAndHarmonicsOfTheBackEmfAreThoseOfTheReference) {
  constexpr int kParts = 3600;
  const BldcMachineConstants c = constants_of(kMotor);
  double square = 0.0;
  Phases sine{};
  double b7 = 0.0;
  for (int n = 0; n < kParts; ++n) {
    const double angle_rad = 2.0 * kPi * (n + 0.5) / kParts;
    const double e = back_emf_shape(c, angle_rad).a;
    square += e * e / kParts;
    for (std::size_t k = 0; k < 3; ++k)
      sine[k] += 2.0 / kParts * e * std::sin((2.0 * static_cast<double>(k) + 1.0) * angle_rad);
    b7 += 2.0 / kParts * e * std::sin(7.0 * angle_rad);
  }
  EXPECT_NEAR(std::sqrt(square), 0.881917, 1e-6);
  EXPECT_NEAR(sine[0], 1.215854, 1e-6);
  EXPECT_NEAR(sine[1], 0.270190, 1e-6);
  EXPECT_NEAR(sine[2], 0.048634, 1e-6);
  EXPECT_NEAR(b7, -0.024813, 1e-6);
}

// AC-27: 2 tau_p I_p without ripple, at every angle but the instants of commutation. Catches: a wrong sign of
// the torque, emfs in another order than the currents.
TEST(BldcMachine, TheCommutationTableGivesAConstantTorque) {
  for (const int pole_pairs : {1, 3}) {
    for (const bool star : {true, false}) {
      BldcMachineParameters p = kMotor;
      p.pole_pairs = pole_pairs;
      p.star = star;
      const BldcMachineConstants c = constants_of(p);
      for (int n = 0; n < 3600; ++n) {
        const double electrical_rad = (0.1 * n + 0.05) * kDegree;
        const Phases i = commutated(electrical_rad);
        ASSERT_EQ(sum(i), 0.0);
        ASSERT_NEAR(torque_nm(c, state_of(i), motion(electrical_rad / pole_pairs)), 1.0256, 1e-9) << n;
      }
    }
  }
}

// The emf has the sense of the terminal voltage, that of the literature is its negative. Catches: E31, an emf
// and a torque that are reversed together, which the power balance would not see.
TEST(BldcMachine, SensesAreThoseOfTheBook) {
  const BldcMachineConstants c = constants_of(kMotor);
  const BldcMachineState standing = derivative(c, {}, motion(0.0), {.voltage_v = {1.0, 2.0}});
  EXPECT_NEAR(standing.i_a_a, 1.0 / 2.87e-3, 1e-9);
  EXPECT_NEAR(standing.i_b_a, 2.0 / 2.87e-3, 1e-9);
  // At 90 degrees e = (1, -1/2 less, ..): with shorted terminals the rotor drives phase a to a positive
  // current, which brakes it.
  const BldcMachineState turning = derivative(c, {}, motion(0.5 * kPi, 100.0), {});
  EXPECT_GT(turning.i_a_a, 0.0);
  EXPECT_LT(torque_nm(c, {.i_a_a = 1.0}, motion(0.5 * kPi)), 0.0);
  EXPECT_NEAR(open_circuit_voltages(c, {}, motion(0.5 * kPi, 100.0)).stator.a,
              -51.28 * std::sqrt(2.0 / 3.0) * 2.0, 1e-9);
}

// BL-08. Catches: any wrong sign or factor, a torque constant that differs from the emf constant, a wrong
// inverse of the inductances with open phases.
TEST(BldcMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  Random random{std::mt19937_64(21)};
  for (unsigned n = 0; n < 10'000; ++n) {
    BldcMachineParameters p = kMotor;
    p.pole_pairs = 1 + static_cast<int>(n % 4);
    p.mutual_inductance_h *= 1.0 + static_cast<double>(n % 7);
    const RotorMotion now = motion(random(4.0), random(500.0));
    const BldcMachineState x = state_of(random.three(20.0));
    TerminalInput u = input_of(random.three(200.0));
    ASSERT_LT(unbalanced(constants_of(p), without_neutral_current(x), now, u), 1e-9) << n;
    p.star = false;
    u.conducts = {.a = n % 2 == 0 ? 1.0 : 0.0, .b = n % 3 == 0 ? 1.0 : 0.0, .c = n % 10 == 0 ? 0.0 : 1.0};
    const BldcMachineConstants c = constants_of(p);
    ASSERT_LT(unbalanced(c, restricted(c, x, now, u), now, u), 1e-9) << n;
  }
}

// The split of a step relies on it: between two whole numbers every emf is straight, at each it has a kink.
// Catches: corners that are not where the position says.
TEST(BldcMachine, TheBackEmfIsStraightBetweenTwoCornerPositions) {
  BldcMachineParameters p = kMotor;
  p.pole_pairs = 3;
  const BldcMachineConstants c = constants_of(p);
  for (int n = 0; n < 18; ++n) {
    const double corner_rad = (30.0 + 60.0 * n) * kDegree / 3.0;
    EXPECT_NEAR(corner_position(c, corner_rad), n, 1e-13 * (n + 1));
    // Of the three emfs one runs from one top to the other between two corners, the others stay on a top.
    const auto bend = [&](double at_rad) {
      const double h = 0.1 * kDegree;
      const auto second = [&](auto of) {
        return of(back_emf_shape(c, at_rad - h)) - 2.0 * of(back_emf_shape(c, at_rad)) +
               of(back_emf_shape(c, at_rad + h));
      };
      return std::abs(second([](ThreePhase e) { return e.a; })) +
             std::abs(second([](ThreePhase e) { return e.b; })) +
             std::abs(second([](ThreePhase e) { return e.c; }));
    };
    EXPECT_NEAR(bend(corner_rad), 2.0 * 0.3 / 30.0, 1e-12);
    for (int part = 1; part < 20; ++part)
      EXPECT_NEAR(bend(corner_rad + part * kDegree), 0.0, 1e-12);
  }
  EXPECT_EQ(pole_pairs_of(p), 3.0);
}

// A step that rounding puts on the wrong side of a corner must not see it. Catches: a jump in e.
TEST(BldcMachine, BothSidesOfACornerGiveTheSameEmf) {
  const BldcMachineConstants c = constants_of(kMotor);
  for (int n = 0; n < 6; ++n) {
    const double corner_rad = (30.0 + 60.0 * n) * kDegree;
    const ThreePhase below = back_emf_shape(c, corner_rad - 1e-15);
    const ThreePhase above = back_emf_shape(c, corner_rad + 1e-15);
    EXPECT_NEAR(below.a, above.a, 1e-14);
    EXPECT_NEAR(below.b, above.b, 1e-14);
    EXPECT_NEAR(below.c, above.c, 1e-14);
  }
}

// BL-02: the slope of the magnet's flux is -e/n_p, its peak 5 pi/12 at angle 0, pi/3 at 30 degrees. Catches:
// a flux that leads where it lags, a wrong cap.
TEST(BldcMachine, TheFluxOfTheMagnetIsTheIntegralOfTheEmf) {
  BldcMachineParameters p = kMotor;
  p.pole_pairs = 2;
  const BldcMachineConstants c = constants_of(p);
  const double scale_wb = 0.5128 / 2.0;
  EXPECT_NEAR(rotor_flux_wb(c, {}, motion(0.0)).a,
              std::sqrt(1.5) * scale_wb * (5.0 / 12.0 * kPi + kPi / 6.0) * 2.0 / 3.0, 1e-12);
  EXPECT_NEAR(rotor_flux_wb(c, {}, motion(0.0)).b, 0.0, 1e-12);
  constexpr double kStep = 1e-5;
  for (double angle_rad = -0.1; angle_rad < 6.4; angle_rad += 0.0371) {
    const TwoPhase from = rotor_flux_wb(c, {}, motion(angle_rad - kStep));
    const TwoPhase to = rotor_flux_wb(c, {}, motion(angle_rad + kStep));
    const TwoPhase open_v = open_circuit_voltages(c, {}, motion(angle_rad, 1.0)).stator;
    // The error next to a corner is at most the change of e within the step.
    ASSERT_NEAR((to.a - from.a) / (2.0 * kStep), open_v.a, 2e-5) << angle_rad;
    ASSERT_NEAR((to.b - from.b) / (2.0 * kStep), open_v.b, 2e-5) << angle_rad;
  }
}

// AC-30, BL-07: with equal copper losses blocks of current on a trapezoid give 2/sqrt(3) of the power of
// sines on a sine of the same peak. Catches: tau_p taken per pair of phases, losses of the wrong phases.
TEST(BldcMachine, WithEqualCopperLossesItGivesFifteenPercentMoreThanASineMachine) {
  const PmMachineConstants sine = constants_of(two_phase_equivalent(
      1, {.resistance_ohm = 0.7, .self_inductance_h = 2e-3, .emf_constant_v_s = 0.5128}));
  const RotorMotion now = motion(45.0 * kDegree);
  const RotorMotion turned{.angle_rad = 0.0, .speed_rad_s = 0.0, .electrical = {1.0, 0.0}};
  const PmMachineState sine_current{.i_b_a = std::sqrt(1.5)};  // phase current of 1 A peak, across the magnet
  const BldcMachineConstants c = constants_of(kMotor);
  Phases block = commutated(now.angle_rad);
  for (double& i : block)
    i *= 0.5 * std::sqrt(3.0);
  EXPECT_NEAR(losses_w(c, state_of(block), now), losses_w(sine, sine_current, turned), 1e-12);
  EXPECT_NEAR(torque_nm(c, state_of(block), now) / torque_nm(sine, sine_current, turned), 1.1547, 1e-4);
}

// Catches: a factor that reaches the wrong parameter, series impedance that is lost, a time constant of the
// wrong inductance, a star that is not declared as one.
TEST(BldcMachine, AdjustmentsTimeConstantAndConnectionFollowTheParameters) {
  const BldcMachineParameters p = adjusted(kMotor, {.stator_resistance_factor = 1.5,
                                                    .rotor_resistance_factor = 9.0,
                                                    .magnet_factor = 0.75,
                                                    .series_resistance_ohm = 0.1,
                                                    .series_inductance_h = 1e-3});
  EXPECT_DOUBLE_EQ(p.stator_resistance_ohm, 1.15);
  EXPECT_DOUBLE_EQ(p.self_inductance_h, 3.72e-3);
  EXPECT_DOUBLE_EQ(p.mutual_inductance_h, 0.15e-3);
  EXPECT_DOUBLE_EQ(p.torque_constant_nm_per_a, 0.3846);
  EXPECT_NEAR(fastest_time_constant_s(kMotor), 4.1e-3, 1e-15);
  EXPECT_NEAR(fastest_time_constant_s(independent()), 2.42e-3 / 0.7, 1e-15);
  EXPECT_EQ(connection_of(kMotor), Connection::kStar);
  EXPECT_EQ(connection_of(independent()), Connection::kIndependent);
}

// Catches: inductances that no windings can have, which make the zero sequence unstable.
TEST(BldcMachine, MutualInductanceMustStayBelowHalfOfTheSelfInductance) {
  std::vector<Problem> found;
  Problems rules(found);
  add_problems(kMotor, rules);
  EXPECT_TRUE(found.empty());
  BldcMachineParameters p = kMotor;
  p.mutual_inductance_h = 0.5 * p.self_inductance_h;
  add_problems(p, rules);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].field, "machine.mutual_inductance_h");
  EXPECT_EQ(found[0].rule, "is 0.00136 but must be below half of self_inductance_h = 0.00272");
  EXPECT_EQ(BldcMachine::kind().rows.size(), 6u);
}

}  // namespace
}  // namespace drivebench::bldc_machine_test
