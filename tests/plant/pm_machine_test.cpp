#include "plant/machines/pm/pm_machine.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "tests/plant/power_balance.hpp"

namespace drivebench::pm_machine_test {
namespace {

constexpr PmMachineParameters kStepper{.pole_pairs = 50,
                                       .stator_resistance_ohm = 0.55,
                                       .inductance_d_h = 1.5e-3,
                                       .inductance_q_h = 1.5e-3,
                                       .torque_constant_nm_per_a = 0.19};
constexpr PmMachineParameters kSalient{.pole_pairs = 3,
                                       .stator_resistance_ohm = 0.4,
                                       .inductance_d_h = 1.1e-3,
                                       .inductance_q_h = 2.9e-3,
                                       .torque_constant_nm_per_a = 0.3,
                                       .detent_torque_nm = 0.2};

struct Point {
  PmMachineState x;
  double angle_rad;
  double speed_rad_s;
  TerminalInput u{};
};

class Points {
 public:
  double draw(double size) { return std::uniform_real_distribution<double>(-size, size)(engine_); }
  Point next(Conduction conduction = Conduction::kFull) {
    const CosSin line = cos_sin(draw(3.0));
    Point p{.x = {draw(20.0), draw(20.0)}, .angle_rad = draw(3.0), .speed_rad_s = draw(900.0)};
    p.u = {.voltage_v = {draw(80.0), draw(80.0)}, .conduction = conduction, .line = {line.cos, line.sin}};
    p.x = restricted(PmMachineConstants{}, p.x, RotorMotion{}, p.u);
    return p;
  }

 private:
  std::mt19937_64 engine_{9};
};

// The book misprints signs, the power balance does not. Catches: any wrong sign or factor in slope, torque,
// energy or losses, with a round rotor, a salient one and detent torque, with one or all phases open.
TEST(PmMachine, InputPowerIsStoredLostOrDeliveredInRandomStates) {
  Points points;
  for (const PmMachineParameters& parameters : {kStepper, kSalient}) {
    const PmMachineConstants c = constants_of(parameters);
    for (const Conduction conduction : {Conduction::kFull, Conduction::kLine, Conduction::kNone}) {
      for (int i = 0; i < 1000; ++i) {
        const Point p = points.next(conduction);
        const RotorMotion motion = motion_at(c, p.angle_rad, p.speed_rad_s);
        EXPECT_LT(unbalanced(c, p.x, motion, p.u), 1e-9);
      }
    }
  }
}

// AC-26. Catches: a power balance that would let (7.81) pass as it is printed. Its back emf has the wrong
// sign, so that the emf takes in what the shaft should get: twice K_m w i_q is missing.
TEST(PmMachine, ThePrintedSignsOf7Point81CreateEnergy) {
  const PmMachineConstants c = constants_of(kStepper);
  const auto printed = [&](const Point& p) -> PmMachineState {
    const double emf_v = c.torque_constant_nm_per_a * p.speed_rad_s;
    const CosSin e = cos_sin(c.pole_pairs * p.angle_rad);
    return {.i_a_a = (-c.resistance_ohm * p.x.i_a_a - emf_v * e.sin + p.u.voltage_v.a) / c.inductance_d_h,
            .i_b_a = (-c.resistance_ohm * p.x.i_b_a + emf_v * e.cos + p.u.voltage_v.b) / c.inductance_d_h};
  };
  Points points;
  int caught = 0;
  for (int i = 0; i < 1000; ++i) {
    const Point p = points.next();
    const RotorMotion motion = motion_at(c, p.angle_rad, p.speed_rad_s);
    if (unbalanced(c, p.x, motion, p.u, printed(p), torque_nm(c, p.x, motion)) > 1e-3) ++caught;
  }
  EXPECT_GT(caught, 990);  // the others have next to no torque or speed
}

// AC-26: v_1 = -K w sin theta with K = sqrt(2/3) K_m. Catches: an emf of the wrong sign or axis; a star that
// forgets the factor; a current that flows all the same.
TEST(PmMachine, TheOpenStarShowsMinusKSpeedSine) {
  const double phase_emf_constant = 0.155;
  const PmMachineConstants c = constants_of(two_phase_equivalent(
      2, {.resistance_ohm = 0.3, .self_inductance_h = 1e-3, .emf_constant_v_s = phase_emf_constant}));
  const TerminalInput open{.conduction = Conduction::kNone};
  for (double angle = -3.0; angle < 3.0; angle += 0.1) {
    const RotorMotion motion = motion_at(c, angle, 123.0);
    const PmMachineState slope = derivative(c, {}, motion, open);
    EXPECT_EQ(slope.i_a_a, 0.0);
    EXPECT_EQ(slope.i_b_a, 0.0);
    const ThreePhase v = two_to_three(open_circuit_voltages(c, {}, motion).stator);
    const double third = 2.0 * std::numbers::pi / 3.0;
    EXPECT_NEAR(v.a, -phase_emf_constant * 123.0 * std::sin(2.0 * angle), 1e-6);
    EXPECT_NEAR(v.b, -phase_emf_constant * 123.0 * std::sin(2.0 * angle - third), 1e-6);
    EXPECT_NEAR(v.c, -phase_emf_constant * 123.0 * std::sin(2.0 * angle + third), 1e-6);
  }
}

// The test vector of PM3-01, to its eight digits. Catches: a wrong factor of the transform, an angle of the
// wrong sign.
TEST(PmMachine, TheTorqueOfThreePhaseCurrentsIsThatOfTheTestVector) {
  const PmMachineConstants c = constants_of({.pole_pairs = 1,
                                             .stator_resistance_ohm = 1.0,
                                             .inductance_d_h = 1e-3,
                                             .inductance_q_h = 1e-3,
                                             .torque_constant_nm_per_a = 0.5,
                                             .star = true});
  const TwoPhase i = three_to_two({3.0, -1.0, -2.0});
  EXPECT_NEAR(torque_nm(c, {i.a, i.b}, motion_at(c, 0.7, 0.0)), -0.91309091, 5e-9);
}

/// L(theta) of the book and its derivative by the angle of the shaft, from L_S and L_g.
struct Inductance {
  double aa, ab, bb;
};

Inductance inductance_h(const PmMachineParameters& p, double angle_rad) {
  const double common = 0.5 * (p.inductance_d_h + p.inductance_q_h);
  const double difference = 0.5 * (p.inductance_d_h - p.inductance_q_h);
  const double cos2 = std::cos(2.0 * p.pole_pairs * angle_rad);
  const double sin2 = std::sin(2.0 * p.pole_pairs * angle_rad);
  return {common + difference * cos2, difference * sin2, common - difference * cos2};
}

Inductance inductance_slope_h(const PmMachineParameters& p, double angle_rad) {
  const double rate = p.pole_pairs * (p.inductance_d_h - p.inductance_q_h);
  const double cos2 = std::cos(2.0 * p.pole_pairs * angle_rad);
  const double sin2 = std::sin(2.0 * p.pole_pairs * angle_rad);
  return {-rate * sin2, rate * cos2, rate * sin2};
}

// Case 35. The coenergy at constant current, i·L(theta) i/2 + i·psi(theta), by a fourth-order difference.
// Catches: the torque as exercise 11 prints it, a lost factor 2 or n_p of the reluctance torque.
TEST(PmMachine, TheTorqueOfASalientRotorIsTheDerivativeOfTheCoenergy) {
  PmMachineParameters parameters = kSalient;
  parameters.detent_torque_nm = 0.0;
  const PmMachineConstants c = constants_of(parameters);
  Points points;
  for (int n = 0; n < 200; ++n) {
    const Point p = points.next();
    const auto coenergy_j = [&](double angle_rad) {
      const Inductance l = inductance_h(parameters, angle_rad);
      const double flux_wb = parameters.torque_constant_nm_per_a / parameters.pole_pairs;
      const double electrical = parameters.pole_pairs * angle_rad;
      return 0.5 * (l.aa * p.x.i_a_a * p.x.i_a_a + l.bb * p.x.i_b_a * p.x.i_b_a) +
             l.ab * p.x.i_a_a * p.x.i_b_a +
             flux_wb * (p.x.i_a_a * std::cos(electrical) + p.x.i_b_a * std::sin(electrical));
    };
    constexpr double kStep_rad = 1e-3;
    const double expected =
        (8.0 * (coenergy_j(p.angle_rad + kStep_rad) - coenergy_j(p.angle_rad - kStep_rad)) -
         (coenergy_j(p.angle_rad + 2.0 * kStep_rad) - coenergy_j(p.angle_rad - 2.0 * kStep_rad))) /
        (12.0 * kStep_rad);
    EXPECT_NEAR(torque_nm(c, p.x, motion_at(c, p.angle_rad, 0.0)), expected, 1e-8);
  }
}

/// L i' = v + r n with n·i' = 0, by Gauss elimination in (i_a', i_b', r). v: what the voltages leave.
PmMachineState constrained_slope(const Inductance& l, TwoPhase v, TwoPhase line) {
  const TwoPhase n = {.a = -line.b, .b = line.a};
  std::array<std::array<double, 4>, 3> m{
      {{l.aa, l.ab, -n.a, v.a}, {l.ab, l.bb, -n.b, v.b}, {n.a, n.b, 0.0, 0.0}}};
  for (std::size_t column = 0; column < 3; ++column) {
    std::size_t pivot = column;
    for (std::size_t row = column; row < 3; ++row) {
      if (std::abs(m[row][column]) > std::abs(m[pivot][column])) pivot = row;
    }
    std::swap(m[column], m[pivot]);
    for (std::size_t row = 0; row < 3; ++row) {
      if (row == column) continue;
      const double factor = m[row][column] / m[column][column];
      for (std::size_t k = column; k < 4; ++k)
        m[row][k] -= factor * m[column][k];
    }
  }
  return {.i_a_a = m[0][3] / m[0][0], .i_b_a = m[1][3] / m[1][1]};
}

// Catches: an open phase that takes a component of the slope of all phases, which is right only for a round
// rotor; a constraint voltage that does work.
TEST(PmMachine, AnOpenPhaseOfASalientMachineObeysTheConstrainedEquations) {
  const PmMachineConstants c = constants_of(kSalient);
  Points points;
  for (int n = 0; n < 500; ++n) {
    const Point p = points.next(Conduction::kLine);
    const RotorMotion motion = motion_at(c, p.angle_rad, p.speed_rad_s);
    const Inductance change = inductance_slope_h(kSalient, p.angle_rad);
    const double emf_v = kSalient.torque_constant_nm_per_a * p.speed_rad_s;
    const double electrical = kSalient.pole_pairs * p.angle_rad;
    const TwoPhase v = {
        p.u.voltage_v.a - kSalient.stator_resistance_ohm * p.x.i_a_a + emf_v * std::sin(electrical) -
            p.speed_rad_s * (change.aa * p.x.i_a_a + change.ab * p.x.i_b_a),
        p.u.voltage_v.b - kSalient.stator_resistance_ohm * p.x.i_b_a - emf_v * std::cos(electrical) -
            p.speed_rad_s * (change.ab * p.x.i_a_a + change.bb * p.x.i_b_a)};
    const Inductance l = inductance_h(kSalient, p.angle_rad);
    const PmMachineState expected = constrained_slope(l, v, p.u.line);
    const PmMachineState slope = derivative(c, p.x, motion, p.u);
    // Slopes reach 1e5 A/s: 1e-12 of that.
    EXPECT_NEAR(slope.i_a_a, expected.i_a_a, 1e-6);
    EXPECT_NEAR(slope.i_b_a, expected.i_b_a, 1e-6);

    // The voltages then are L i' and all that v took off; along the line they are those applied.
    const TwoPhase at_windings = winding_voltages(c, p.x, motion, p.u).stator;
    const TwoPhase reaction = {l.aa * expected.i_a_a + l.ab * expected.i_b_a - v.a,
                               l.ab * expected.i_a_a + l.bb * expected.i_b_a - v.b};
    EXPECT_NEAR(at_windings.a, p.u.voltage_v.a + reaction.a, 1e-9);
    EXPECT_NEAR(at_windings.b, p.u.voltage_v.b + reaction.b, 1e-9);
  }
}

// Catches: a projection that keeps the wrong part of the current.
TEST(PmMachine, TheRestrictedStateKeepsTheCurrentAlongTheLineOnly) {
  const PmMachineConstants c = constants_of(kSalient);
  const RotorMotion motion = motion_at(c, 0.3, 10.0);
  const PmMachineState x{.i_a_a = 3.0, .i_b_a = 4.0};
  const PmMachineState full = restricted(c, x, motion, {});
  EXPECT_EQ(full.i_a_a, 3.0);
  EXPECT_EQ(full.i_b_a, 4.0);
  const PmMachineState along =
      restricted(c, x, motion, {.conduction = Conduction::kLine, .line = {.a = 0.0, .b = 1.0}});
  EXPECT_EQ(along.i_a_a, 0.0);
  EXPECT_EQ(along.i_b_a, 4.0);
  const PmMachineState none = restricted(c, x, motion, {.conduction = Conduction::kNone});
  EXPECT_EQ(none.i_a_a, 0.0);
  EXPECT_EQ(none.i_b_a, 0.0);
}

// Catches: an adjustment that takes the wrong factor or leaves one inductance behind.
TEST(PmMachine, HeatSeriesImpedanceAndMagnetChangeTheirOwnParameters) {
  const PmMachineParameters p = adjusted(kSalient, {.stator_resistance_factor = 1.5,
                                                    .rotor_resistance_factor = 7.0,
                                                    .magnet_factor = 0.5,
                                                    .series_resistance_ohm = 0.1,
                                                    .series_inductance_h = 1e-3});
  EXPECT_DOUBLE_EQ(p.stator_resistance_ohm, 0.7);
  EXPECT_DOUBLE_EQ(p.inductance_d_h, 2.1e-3);
  EXPECT_DOUBLE_EQ(p.inductance_q_h, 3.9e-3);
  EXPECT_DOUBLE_EQ(p.torque_constant_nm_per_a, 0.15);
  EXPECT_DOUBLE_EQ(p.detent_torque_nm, 0.05);
  EXPECT_DOUBLE_EQ(fastest_time_constant_s(kSalient), 1.1e-3 / 0.4);
  EXPECT_EQ(pole_pairs_of(kSalient), 3.0);
  EXPECT_EQ(connection_of(kSalient), Connection::kTwoPhase);
  EXPECT_EQ(connection_of(two_phase_equivalent(2, {1.0, 1e-3, 0.1})), Connection::kStar);
}

// Catches: a flux that is not that behind the emf: d(psi)/dt is the open-circuit voltage.
TEST(PmMachine, TheEmfIsTheRateOfTheRotorFlux) {
  const PmMachineConstants c = constants_of(kSalient);
  constexpr double kSpeed_rad_s = 40.0;
  constexpr double kStep_s = 1e-6;
  const TwoPhase before = rotor_flux_wb(c, {}, motion_at(c, 0.3 - kSpeed_rad_s * kStep_s, kSpeed_rad_s));
  const TwoPhase after = rotor_flux_wb(c, {}, motion_at(c, 0.3 + kSpeed_rad_s * kStep_s, kSpeed_rad_s));
  const TwoPhase emf_v = open_circuit_voltages(c, {}, motion_at(c, 0.3, kSpeed_rad_s)).stator;
  EXPECT_NEAR(emf_v.a, (after.a - before.a) / (2.0 * kStep_s), 1e-6);
  EXPECT_NEAR(emf_v.b, (after.b - before.b) / (2.0 * kStep_s), 1e-6);
}

}  // namespace
}  // namespace drivebench::pm_machine_test
