#include "plant/machines/induction/induction_machine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>

#include "tests/plant/induction_motors.hpp"
#include "tests/plant/power_balance.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::induction_machine_test {
namespace {

using induction_motors::turning;

struct Point {
  InductionMachineState x;
  double speed_rad_s;
  TwoPhase voltage_v;
};

Point random_point(std::mt19937_64& engine) {
  const auto draw = [&engine](double size) {
    return std::uniform_real_distribution<double>(-size, size)(engine);
  };
  return {.x = {draw(20.0), draw(20.0), draw(0.2), draw(0.2)},
          .speed_rad_s = draw(900.0),
          .voltage_v = {draw(80.0), draw(80.0)}};
}

// Case 1 of the reference table, tolerance 5e-5 relative. Catches: exchanged inductances, a lost square.
TEST(InductionMachine, TheServoMotorHasTheDerivedConstantsOfTheReference) {
  const InductionMachineConstants c = constants_of(kServoMachine);
  const auto expect = [](double value, double reference) { EXPECT_NEAR(value, reference, 5e-5 * reference); };
  expect(c.sigma, 0.30158);
  expect(c.transient_inductance_h, 4.2221e-3);
  expect(c.transient_reluctance_per_h, 1.0 / 4.2221e-3);
  expect(c.eta_per_s, 278.571);
  expect(c.beta_per_h, 197.936);
  expect(c.gamma_per_s, 1047.77);
  expect(c.torque_constant, 2.5071);
  expect(c.torque_constant / kServoInertia_kgm2, 22792.2);
  EXPECT_EQ(leakage_factor(kServoMachine), c.sigma);
}

// The same with all five parameters different, by the definitions of the model. Catches: L_R taken for L_S,
// which the servo motor (L_R = L_S) cannot show.
TEST(InductionMachine, RotorAndStatorInductanceAreNotExchanged) {
  const InductionMachineConstants c = constants_of({.pole_pairs = 2,
                                                    .stator_resistance_ohm = 9.7,
                                                    .rotor_resistance_ohm = 8.6,
                                                    .stator_inductance_h = 0.67,
                                                    .rotor_inductance_h = 0.4,
                                                    .mutual_inductance_h = 0.49});
  const double sigma = 1.0 - 0.49 * 0.49 / (0.67 * 0.4);
  EXPECT_NEAR(c.sigma, sigma, 1e-15);
  EXPECT_NEAR(c.eta_per_s, 8.6 / 0.4, 1e-12);
  EXPECT_NEAR(c.beta_per_h, 0.49 / (sigma * 0.67 * 0.4), 1e-12);
  EXPECT_NEAR(c.gamma_per_s, 0.49 * 0.49 * 8.6 / (sigma * 0.4 * 0.4 * 0.67) + 9.7 / (sigma * 0.67), 1e-10);
  EXPECT_NEAR(c.torque_constant, 2.0 * 0.49 / 0.4, 1e-15);
}

// Case 3. The book misprints signs, the power balance does not. Catches: any wrong sign or factor in the
// model.
TEST(InductionMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  std::mt19937_64 engine(11);
  for (int i = 0; i < 10'000; ++i) {
    InductionMachineParameters p = kServoMachine;
    p.pole_pairs = 1 + i % 4;
    p.rotor_inductance_h *= 1.0 + 0.1 * (i % 3);
    const InductionMachineConstants c = constants_of(p);
    const Point point = random_point(engine);
    const RotorMotion motion = turning(point.speed_rad_s);
    const TerminalInput u{.voltage_v = point.voltage_v};
    const double kept_w = storing_w(c, point.x, motion, derivative(c, point.x, motion, u)) +
                          losses_w(c, point.x, motion) + torque_nm(c, point.x, motion) * motion.speed_rad_s;
    // Relative to |u_a i_a| + |u_b i_b|, since the phases may cancel.
    ASSERT_NEAR(input_w(c, point.x, motion, u), kept_w, 1e-9 * exchanged_w(c, point.x, motion, u))
        << "state " << i;
  }
}

constexpr std::size_t kTerms = 16;
struct TermByTerm {
  InductionMachineState slope;
  double torque_nm;
};

/// The model once more, each term with a sign of its own.
TermByTerm signed_model(const InductionMachineConstants& c, const Point& p,
                        const std::array<double, kTerms>& sign) {
  const auto& [i_a, i_b, psi_a, psi_b] = p.x;
  const double w = c.pole_pairs * p.speed_rad_s;
  const double eta = c.eta_per_s;
  const double beta = c.beta_per_h;
  const double inverse = 1.0 / (c.sigma * kServoMachine.stator_inductance_h);
  const double magnetising = eta * c.mutual_inductance_h;
  return {
      .slope = {.i_a_a = sign[0] * eta * beta * psi_a + sign[1] * beta * w * psi_b -
                         sign[2] * c.gamma_per_s * i_a + sign[3] * p.voltage_v.a * inverse,
                .i_b_a = sign[4] * eta * beta * psi_b - sign[5] * beta * w * psi_a -
                         sign[6] * c.gamma_per_s * i_b + sign[7] * p.voltage_v.b * inverse,
                .psi_a_wb = -sign[8] * eta * psi_a - sign[9] * w * psi_b + sign[10] * magnetising * i_a,
                .psi_b_wb = -sign[11] * eta * psi_b + sign[12] * w * psi_a + sign[13] * magnetising * i_b},
      .torque_nm = c.torque_constant * (sign[14] * i_b * psi_a - sign[15] * i_a * psi_b)};
}

// Proves that the balance above notices every sign, and that the product has the signs of the copy.
TEST(InductionMachine, FlippingAnySignBreaksThePowerBalance) {
  const InductionMachineConstants c = constants_of(kServoMachine);
  std::array<double, kTerms> sign;
  sign.fill(1.0);
  for (std::size_t flipped = 0; flipped <= kTerms; ++flipped) {
    if (flipped < kTerms) sign[flipped] = -1.0;
    std::mt19937_64 engine(12);
    double worst = 0.0;
    for (int i = 0; i < 100; ++i) {
      const Point point = random_point(engine);
      const TermByTerm model = signed_model(c, point, sign);
      worst = std::max(worst, unbalanced(c, point.x, turning(point.speed_rad_s),
                                         {.voltage_v = point.voltage_v}, model.slope, model.torque_nm));
      if (flipped < kTerms) continue;
      const InductionMachineState slope =
          derivative(c, point.x, turning(point.speed_rad_s), {.voltage_v = point.voltage_v});
      EXPECT_NEAR(slope.i_a_a, model.slope.i_a_a, 1e-8);
      EXPECT_NEAR(slope.i_b_a, model.slope.i_b_a, 1e-8);
      EXPECT_NEAR(slope.psi_a_wb, model.slope.psi_a_wb, 1e-11);
      EXPECT_NEAR(slope.psi_b_wb, model.slope.psi_b_wb, 1e-11);
      EXPECT_NEAR(torque_nm(c, point.x, turning(point.speed_rad_s)), model.torque_nm, 1e-12);
    }
    if (flipped < kTerms) {
      EXPECT_GT(worst, 0.01) << "term " << flipped;
      sign[flipped] = 1.0;
    } else {
      EXPECT_LT(worst, 1e-9);
    }
  }
}

// Conventions: a positive voltage gives a positive current at standstill, and a current ahead of the flux
// (from a to b) a positive torque. Catches: a wrong pair of signs that leaves the power balance intact.
TEST(InductionMachine, PositiveVoltageDrivesPositiveCurrentAndCurrentAheadOfTheFluxPositiveTorque) {
  const InductionMachineConstants c = constants_of(kServoMachine);
  const InductionMachineState slope = derivative(c, {}, turning(0.0), {.voltage_v = {1.0, 2.0}});
  EXPECT_NEAR(slope.i_a_a, 1.0 / 4.2221e-3, 0.02);
  EXPECT_NEAR(slope.i_b_a, 2.0 / 4.2221e-3, 0.04);
  EXPECT_GT(torque_nm(c, {.i_b_a = 1.0, .psi_a_wb = 0.1}, turning(0.0)), 0.0);
  EXPECT_LT(torque_nm(c, {.i_a_a = 1.0, .psi_b_wb = 0.1}, turning(0.0)), 0.0);
}

// Catches: an open phase that drifts, a back-emf of the wrong sign, a current that is left where none can
// flow.
TEST(InductionMachine, TheOpenCircuitVoltageKeepsTheCurrentAtZeroAndAnOpenPhaseKeepsItsOwn) {
  const InductionMachineConstants c = constants_of(kServoMachine);
  const InductionMachineState x{.psi_a_wb = 0.03, .psi_b_wb = -0.05};
  const WindingValues open_v = open_circuit_voltages(c, x, turning(150.0));
  const InductionMachineState connected = derivative(c, x, turning(150.0), {.voltage_v = open_v.stator});
  EXPECT_NEAR(connected.i_a_a, 0.0, 1e-10);
  EXPECT_NEAR(connected.i_b_a, 0.0, 1e-10);

  const TerminalInput line{.voltage_v = {55.0, 55.0}, .conduction = Conduction::kLine, .line = {1.0, 0.0}};
  const InductionMachineState open = derivative(c, x, turning(150.0), line);
  EXPECT_NE(open.i_a_a, 0.0);
  EXPECT_EQ(open.i_b_a, 0.0);
  const InductionMachineState left =
      restricted(c, {.i_a_a = 2.0, .i_b_a = 3.0, .psi_a_wb = 0.03}, turning(150.0), line);
  EXPECT_EQ(left.i_a_a, 2.0);
  EXPECT_EQ(left.i_b_a, 0.0);
  EXPECT_EQ(left.psi_a_wb, 0.03);

  const TerminalInput none{.voltage_v = {55.0, 55.0}, .conduction = Conduction::kNone, .line = {1.0, 0.0}};
  EXPECT_EQ(derivative(c, x, turning(150.0), none).i_a_a, 0.0);
  EXPECT_EQ(derivative(c, x, turning(150.0), none).i_b_a, 0.0);
  EXPECT_NE(derivative(c, x, turning(150.0), none).psi_a_wb, 0.0);
}

// Catches: a factor that reaches the wrong parameter, series impedance that is lost, an axis that is never
// told that its machine is a star.
TEST(InductionMachine, AdjustmentsTimeConstantAndConnectionFollowTheParameters) {
  InductionMachineParameters p = adjusted(kServoMachine, {.stator_resistance_factor = 2.0,
                                                          .rotor_resistance_factor = 3.0,
                                                          .magnet_factor = 0.1,
                                                          .series_resistance_ohm = 0.1,
                                                          .series_inductance_h = 1e-3});
  EXPECT_DOUBLE_EQ(p.stator_resistance_ohm, 3.5);
  EXPECT_DOUBLE_EQ(p.rotor_resistance_ohm, 11.7);
  EXPECT_DOUBLE_EQ(p.stator_inductance_h, 0.015);
  EXPECT_DOUBLE_EQ(p.rotor_inductance_h, 0.014);
  EXPECT_DOUBLE_EQ(p.mutual_inductance_h, 0.0117);
  EXPECT_NEAR(fastest_time_constant_s(kServoMachine), 809e-6, 1e-6) << "1/gamma is 954e-6";
  EXPECT_EQ(connection_of(p), Connection::kTwoPhase);
  p.star = true;
  EXPECT_EQ(connection_of(p), Connection::kStar);
  EXPECT_EQ(pole_pairs_of(p), 0.0);  // no angle in the equations
}

// At standstill current and flux along one axis have a matrix of slopes; -1/tau is an eigenvalue of it, and
// the one farther from zero. Catches: a time constant from the current alone, or the slower of the two.
TEST(InductionMachine, TheFastestTimeConstantIsThatOfCurrentAndFluxTogether) {
  const InductionMachineConstants c = constants_of(kServoMachine);
  const RotorMotion still{.angle_rad = 0.0, .speed_rad_s = 0.0, .electrical = {1.0, 0.0}};
  const InductionMachineState of_current = derivative(c, {.i_a_a = 1.0}, still, {});
  const InductionMachineState of_flux = derivative(c, {.psi_a_wb = 1.0}, still, {});
  const double rate = -1.0 / fastest_time_constant_s(kServoMachine);
  EXPECT_NEAR((of_current.i_a_a - rate) * (of_flux.psi_a_wb - rate) - of_current.psi_a_wb * of_flux.i_a_a,
              0.0, 1e-9 * rate * rate);
  EXPECT_LT(rate, 0.5 * (of_current.i_a_a + of_flux.psi_a_wb));
}

}  // namespace
}  // namespace drivebench::induction_machine_test
