#include "plant/machines/wound_rotor/wound_rotor_machine.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/plant/power_balance.hpp"

namespace drivebench::wound_rotor_machine_test {
namespace {

constexpr WoundRotorMachineParameters kMachine{.pole_pairs = 2,
                                               .stator_resistance_ohm = 0.7,
                                               .field_resistance_ohm = 5.0,
                                               .stator_inductance_h = 0.02,
                                               .field_inductance_h = 0.9,
                                               .mutual_inductance_h = 0.12};

struct Point {
  WoundRotorMachineState x{};
  double angle_rad = 0.0;
  double speed_rad_s = 0.0;
  TerminalInput u{};
};

class Points {
 public:
  double draw(double size) { return std::uniform_real_distribution<double>(-size, size)(engine_); }
  Point next(Conduction conduction = Conduction::kFull) {
    const CosSin line = cos_sin(draw(3.0));
    Point p{.x = {draw(20.0), draw(20.0), draw(10.0)}, .angle_rad = draw(3.0), .speed_rad_s = draw(300.0)};
    p.u = {.voltage_v = {draw(80.0), draw(80.0)},
           .field_v = draw(100.0),
           .conduction = conduction,
           .line = {line.cos, line.sin}};
    const WoundRotorMachineConstants c = constants_of(kMachine);
    p.x = restricted(c, p.x, motion_at(c, p.angle_rad, p.speed_rad_s), p.u);
    return p;
  }

 private:
  std::mt19937_64 engine_{61};
};

// Catches: any wrong sign or factor in slope, torque, energy or losses, with one or all stator phases open
// too: a machine whose field does not feel what the stator feels of it.
TEST(WoundRotorMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  const WoundRotorMachineConstants c = constants_of(kMachine);
  Points points;
  for (const Conduction conduction : {Conduction::kFull, Conduction::kLine, Conduction::kNone}) {
    for (int i = 0; i < 1000; ++i) {
      const Point p = points.next(conduction);
      const RotorMotion motion = motion_at(c, p.angle_rad, p.speed_rad_s);
      EXPECT_LT(unbalanced(c, p.x, motion, p.u), 1e-9);
    }
  }
}

// SM-03 with the corrections of E27, the equations along and across the field solved for the slopes. Catches:
// n_p missing in the torque or in one of the speed voltages, M in place of M/L_S, R_F of the wrong sign.
TEST(WoundRotorMachine, SlopesAndTorqueAreThoseOfTheEquationsAlongTheField) {
  const WoundRotorMachineConstants c = constants_of(kMachine);
  const double sigma = leakage_factor(kMachine);
  const double l_s = kMachine.stator_inductance_h;
  const double l_f = kMachine.field_inductance_h;
  const double m = kMachine.mutual_inductance_h;
  const double r_s = kMachine.stator_resistance_ohm;
  const double r_f = kMachine.field_resistance_ohm;
  Points points;
  for (int n = 0; n < 200; ++n) {
    const Point p = points.next();
    const RotorMotion motion = motion_at(c, p.angle_rad, p.speed_rad_s);
    const Dq i = to_dq({p.x.i_a_a, p.x.i_b_a}, motion.electrical);
    const Dq u = to_dq(p.u.voltage_v, motion.electrical);
    const double i_f = p.x.i_field_a;
    const double omega_e = 2.0 * p.speed_rad_s;
    const double i_d_slope = (-r_s / l_s * i.d + omega_e * i.q + m * r_f / (l_s * l_f) * i_f) / sigma +
                             (l_f * u.d - m * p.u.field_v) / (sigma * l_s * l_f);
    const double i_q_slope = -omega_e * i.d - r_s / l_s * i.q - omega_e * m / l_s * i_f + u.q / l_s;
    const double i_f_slope =
        (m * r_s / (l_s * l_f) * i.d - omega_e * m / l_f * i.q - r_f / l_f * i_f) / sigma +
        (-m * u.d + l_s * p.u.field_v) / (sigma * l_s * l_f);

    const WoundRotorMachineState slope = derivative(c, p.x, motion, p.u);
    const Dq stator_slope = to_dq({slope.i_a_a, slope.i_b_a}, motion.electrical);
    // Turning axes add omega_e i. Slopes reach 1e5 A/s: 1e-13 of that.
    EXPECT_NEAR(stator_slope.d + omega_e * i.q, i_d_slope, 1e-8);
    EXPECT_NEAR(stator_slope.q - omega_e * i.d, i_q_slope, 1e-8);
    EXPECT_NEAR(slope.i_field_a, i_f_slope, 1e-8);
    EXPECT_NEAR(torque_nm(c, p.x, motion), 2.0 * m * i_f * i.q, 1e-11);
  }
}

// Catches: a coupling from the field to the stator that is not the one back: d(i_F')/du_a = d(i_a')/du_F.
TEST(WoundRotorMachine, StatorAndFieldCoupleReciprocally) {
  const WoundRotorMachineConstants c = constants_of(kMachine);
  Points points;
  for (const Conduction conduction : {Conduction::kFull, Conduction::kLine}) {
    for (int n = 0; n < 50; ++n) {
      const Point p = points.next(conduction);
      const RotorMotion motion = motion_at(c, p.angle_rad, p.speed_rad_s);
      const auto answer = [&](double u_a_v, double u_b_v, double u_field_v) {
        TerminalInput u = p.u;
        u.voltage_v = {u_a_v, u_b_v};
        u.field_v = u_field_v;
        return derivative(c, {}, motion, u);
      };
      EXPECT_NEAR(answer(1.0, 0.0, 0.0).i_field_a, answer(0.0, 0.0, 1.0).i_a_a, 1e-12);
      EXPECT_NEAR(answer(0.0, 1.0, 0.0).i_field_a, answer(0.0, 0.0, 1.0).i_b_a, 1e-12);
      EXPECT_NEAR(answer(0.0, 1.0, 0.0).i_a_a, answer(1.0, 0.0, 0.0).i_b_a, 1e-12);
    }
  }
}

// Catches: an open stator that still weighs on the field; a voltage of the open windings without the part
// that a changing field current induces.
TEST(WoundRotorMachine, WithAnOpenStatorTheFieldIsACoilWhoseFluxInducesTheVoltage) {
  const WoundRotorMachineConstants c = constants_of(kMachine);
  constexpr double kSpeed_rad_s = 50.0;
  constexpr double kAngle_rad = 0.4;
  const TerminalInput u{.field_v = 30.0, .conduction = Conduction::kNone};
  const WoundRotorMachineState x{.i_field_a = 2.0};
  const RotorMotion motion = motion_at(c, kAngle_rad, kSpeed_rad_s);
  const double i_f_slope = (30.0 - 5.0 * 2.0) / 0.9;
  const WoundRotorMachineState slope = derivative(c, x, motion, u);
  EXPECT_EQ(slope.i_a_a, 0.0);
  EXPECT_EQ(slope.i_b_a, 0.0);
  EXPECT_NEAR(slope.i_field_a, i_f_slope, 1e-12);

  constexpr double kStep_s = 1e-6;
  const auto flux_wb = [&](double dt) {
    return rotor_flux_wb(c, {.i_field_a = 2.0 + dt * i_f_slope},
                         motion_at(c, kAngle_rad + dt * kSpeed_rad_s, kSpeed_rad_s));
  };
  const TwoPhase before = flux_wb(-kStep_s);
  const TwoPhase after = flux_wb(kStep_s);
  const WindingValues v = winding_voltages(c, x, motion, u);
  EXPECT_NEAR(v.stator.a, (after.a - before.a) / (2.0 * kStep_s), 1e-6);
  EXPECT_NEAR(v.stator.b, (after.b - before.b) / (2.0 * kStep_s), 1e-6);
  EXPECT_EQ(v.field, 30.0);
  const WindingValues open = open_circuit_voltages(c, x, motion, 30.0);
  EXPECT_NEAR(open.stator.a, v.stator.a, 1e-12);
  EXPECT_NEAR(open.stator.b, v.stator.b, 1e-12);
  EXPECT_EQ(open.field, 30.0);

  // With a field current that does not change both are the same.
  const TerminalInput steady{.field_v = 10.0, .conduction = Conduction::kNone};
  const TwoPhase steady_v = winding_voltages(c, x, motion, steady).stator;
  const WindingValues open_v = open_circuit_voltages(c, x, motion);
  EXPECT_NEAR(steady_v.a, open_v.stator.a, 1e-12);
  EXPECT_NEAR(steady_v.b, open_v.stator.b, 1e-12);
  EXPECT_EQ(open_v.field, 10.0);
  EXPECT_NEAR(two_to_three(open_v.stator).a, -std::sqrt(2.0 / 3.0) * 2.0 * 50.0 * 0.12 * 2.0 * std::sin(0.8),
              1e-12);
}

// Catches: an open phase that takes a component of the slope of all phases, or a field that still sees the
// part of the stator that is open. The applied voltages come back along the line, R i + d(flux)/dt holds
// everywhere.
TEST(WoundRotorMachine, AnOpenPhaseObeysTheEquationsOfTheTwoCircuitsThatAreLeft) {
  const WoundRotorMachineConstants c = constants_of(kMachine);
  Points points;
  for (int n = 0; n < 200; ++n) {
    const Point p = points.next(Conduction::kLine);
    const RotorMotion motion = motion_at(c, p.angle_rad, p.speed_rad_s);
    const TwoPhase l = p.u.line;
    // Current y along the line and field: mutual inductance m(theta) = M cos(n_p theta - angle of the line).
    const double y = l.a * p.x.i_a_a + l.b * p.x.i_b_a;
    const double line_rad = std::atan2(l.b, l.a);
    const double m = 0.12 * std::cos(2.0 * p.angle_rad - line_rad);
    const double m_rate = -0.12 * std::sin(2.0 * p.angle_rad - line_rad) * 2.0 * p.speed_rad_s;
    const double v_line = l.a * p.u.voltage_v.a + l.b * p.u.voltage_v.b - 0.7 * y - m_rate * p.x.i_field_a;
    const double v_field = p.u.field_v - 5.0 * p.x.i_field_a - m_rate * y;
    const double determinant = 0.02 * 0.9 - m * m;
    const double y_slope = (0.9 * v_line - m * v_field) / determinant;
    const double i_f_slope = (0.02 * v_field - m * v_line) / determinant;

    const WoundRotorMachineState slope = derivative(c, p.x, motion, p.u);
    EXPECT_NEAR(slope.i_a_a, y_slope * l.a, 1e-8);
    EXPECT_NEAR(slope.i_b_a, y_slope * l.b, 1e-8);
    EXPECT_NEAR(slope.i_field_a, i_f_slope, 1e-8);
    const TwoPhase v = winding_voltages(c, p.x, motion, p.u).stator;
    EXPECT_NEAR(l.a * v.a + l.b * v.b, l.a * p.u.voltage_v.a + l.b * p.u.voltage_v.b, 1e-10);
    // Across the line only the field induces a voltage.
    const double across =
        0.12 * (std::sin(2.0 * p.angle_rad - line_rad) * i_f_slope +
                std::cos(2.0 * p.angle_rad - line_rad) * 2.0 * p.speed_rad_s * p.x.i_field_a);
    EXPECT_NEAR(l.a * v.b - l.b * v.a, across, 1e-10);
  }
}

// Catches: a stator current that is cut off and takes its share of the field flux with it.
TEST(WoundRotorMachine, CuttingTheStatorCurrentLeavesTheFluxOfTheField) {
  const WoundRotorMachineConstants c = constants_of(kMachine);
  const RotorMotion motion = motion_at(c, 0.3, 0.0);
  const WoundRotorMachineState x{.i_a_a = 7.0, .i_b_a = -4.0, .i_field_a = 2.0};
  const auto field_flux_wb = [&](const WoundRotorMachineState& s) {
    return 0.9 * s.i_field_a + 0.12 * (s.i_a_a * std::cos(0.6) + s.i_b_a * std::sin(0.6));
  };
  for (const Conduction conduction : {Conduction::kFull, Conduction::kLine, Conduction::kNone}) {
    const WoundRotorMachineState after =
        restricted(c, x, motion, {.conduction = conduction, .line = {.a = 0.6, .b = 0.8}});
    EXPECT_NEAR(field_flux_wb(after), field_flux_wb(x), 1e-15);
    if (conduction == Conduction::kFull) {
      EXPECT_EQ(after.i_a_a, 7.0);
      EXPECT_EQ(after.i_field_a, 2.0);
    }
    if (conduction == Conduction::kNone) {
      EXPECT_EQ(after.i_a_a, 0.0);
      EXPECT_EQ(after.i_b_a, 0.0);
    }
  }
}

// Catches: a time constant from one winding alone, or the slower of the two of the coupled windings. At
// standstill the slopes of stator current along the field and of the field current are a matrix; -1/tau is an
// eigenvalue of it, and the one farther from zero.
TEST(WoundRotorMachine, TheFastestTimeConstantIsThatOfTheCoupledWindings) {
  const WoundRotorMachineConstants c = constants_of(kMachine);
  const double tau_s = fastest_time_constant_s(kMachine);
  const RotorMotion motion = motion_at(c, 0.0, 0.0);
  const WoundRotorMachineState of_stator = derivative(c, {1.0, 0.0, 0.0}, motion, {});
  const WoundRotorMachineState of_field = derivative(c, {0.0, 0.0, 1.0}, motion, {});
  const double rate = -1.0 / tau_s;
  EXPECT_NEAR((of_stator.i_a_a - rate) * (of_field.i_field_a - rate) - of_stator.i_field_a * of_field.i_a_a,
              0.0, 1e-9 * rate * rate);
  EXPECT_GT(-rate, 0.5 * -(of_stator.i_a_a + of_field.i_field_a));
}

// Catches: an adjustment that takes the wrong factor.
TEST(WoundRotorMachine, HeatAndSeriesImpedanceChangeTheirOwnParameters) {
  const WoundRotorMachineParameters p = adjusted(kMachine, {.stator_resistance_factor = 2.0,
                                                            .rotor_resistance_factor = 3.0,
                                                            .magnet_factor = 0.5,
                                                            .series_resistance_ohm = 0.1,
                                                            .series_inductance_h = 0.01});
  EXPECT_DOUBLE_EQ(p.stator_resistance_ohm, 1.5);
  EXPECT_DOUBLE_EQ(p.field_resistance_ohm, 15.0);
  EXPECT_DOUBLE_EQ(p.stator_inductance_h, 0.03);
  EXPECT_EQ(p.field_inductance_h, 0.9);
  EXPECT_EQ(p.mutual_inductance_h, 0.12);
  EXPECT_EQ(pole_pairs_of(p), 2.0);
  EXPECT_EQ(connection_of(p), Connection::kTwoPhase);
}

}  // namespace
}  // namespace drivebench::wound_rotor_machine_test
