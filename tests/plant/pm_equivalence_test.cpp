#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "plant/machines/pm/pm_machine.hpp"
#include "plant/machines/wound_rotor/wound_rotor_machine.hpp"
#include "plant/math/rk4.hpp"

/// The same machine described in two ways must move in the same way. The one to compare with is written
/// here from the book's equations and shares no code with the machines.
namespace drivebench::pm_equivalence_test {
namespace {

constexpr double kThird_rad = 2.0 * std::numbers::pi / 3.0;

template <class Machine>
struct Drive {
  typename Machine::State machine{};
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;
};

template <class Machine, class Input>
Drive<Machine> integrated(const typename Machine::Constants& c, Drive<Machine> x, double inertia_kgm2,
                          double step_s, int steps, const Input& input_at) {
  for (int n = 0; n < steps; ++n) {
    const TerminalInput u = input_at(n * step_s);
    x = rk4_step(x, step_s, [&](const Drive<Machine>& y) noexcept -> Drive<Machine> {
      const RotorMotion motion{.angle_rad = y.angle_rad,
                               .speed_rad_s = y.speed_rad_s,
                               .electrical = cos_sin(c.pole_pairs * y.angle_rad)};
      return {.machine = derivative(c, y.machine, motion, u),
              .speed_rad_s = torque_nm(c, y.machine, motion) / inertia_kgm2,
              .angle_rad = y.speed_rad_s};
    });
  }
  return x;
}

/// Terminal voltages that are neither balanced nor free of a common part.
ThreePhase unbalanced_v(double time_s) {
  const double phase = 400.0 * time_s;
  return {.a = 30.0 * std::cos(phase) + 5.0,
          .b = 22.0 * std::cos(phase - kThird_rad),
          .c = 27.0 * std::cos(phase + kThird_rad) + 3.0};
}

/// Their voltages against the motor's neutral.
std::array<double, 3> of_windings(const ThreePhase& u) {
  const double neutral_v = (u.a + u.b + u.c) / 3.0;
  return {u.a - neutral_v, u.b - neutral_v, u.c - neutral_v};
}

struct ThreePhaseDrive {
  ThreePhase current_a{};
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;
};

// PM3-01 in phase quantities, (3L/2) i_k' = u_k - R i_k + K w sin(n_p theta - (k - 1) 120 degrees). Catches:
// wrong factors of the two-phase equivalent, a common voltage that acts, phases in the wrong order. Both sums
// are the same but for rounding: 1e-9.
TEST(PmEquivalence, TheThreePhaseStarMovesAsItsTwoPhaseEquivalent) {
  constexpr PmMachinePhase kPhase{
      .resistance_ohm = 0.3, .self_inductance_h = 0.8e-3, .emf_constant_v_s = 0.11};
  constexpr int kPolePairs = 3;
  constexpr double kInertia_kgm2 = 2e-4;
  constexpr double kStep_s = 20e-6;
  constexpr int kSteps = 5000;

  ThreePhaseDrive x{.current_a = {1.0, -0.4, -0.6}, .speed_rad_s = 100.0, .angle_rad = 0.2};
  const Drive<PmMachine> start{.machine = {three_to_two(x.current_a).a, three_to_two(x.current_a).b},
                               .speed_rad_s = 100.0,
                               .angle_rad = 0.2};
  const PmMachineConstants c = constants_of(two_phase_equivalent(kPolePairs, kPhase));
  const Drive<PmMachine> two = integrated<PmMachine>(
      c, start, kInertia_kgm2, kStep_s, kSteps,
      [](double time_s) -> TerminalInput { return {.voltage_v = three_to_two(unbalanced_v(time_s))}; });

  for (int n = 0; n < kSteps; ++n) {
    const std::array<double, 3> u = of_windings(unbalanced_v(n * kStep_s));
    x = rk4_step(x, kStep_s, [&](const ThreePhaseDrive& y) noexcept -> ThreePhaseDrive {
      const double electrical = kPolePairs * y.angle_rad;
      const double emf_v = kPhase.emf_constant_v_s * y.speed_rad_s;
      const double inductance_h = 1.5 * kPhase.self_inductance_h;
      const std::array<double, 3> sines{std::sin(electrical), std::sin(electrical - kThird_rad),
                                        std::sin(electrical - 2.0 * kThird_rad)};
      const auto slope = [&](double u_v, double i_a, double sine) {
        return (u_v - kPhase.resistance_ohm * i_a + emf_v * sine) / inductance_h;
      };
      const ThreePhase i = y.current_a;
      const double torque = -kPhase.emf_constant_v_s * (i.a * sines[0] + i.b * sines[1] + i.c * sines[2]);
      return {
          .current_a = {slope(u[0], i.a, sines[0]), slope(u[1], i.b, sines[1]), slope(u[2], i.c, sines[2])},
          .speed_rad_s = torque / kInertia_kgm2,
          .angle_rad = y.speed_rad_s};
    });
  }
  const ThreePhase i = two_to_three({two.machine.i_a_a, two.machine.i_b_a});
  EXPECT_NEAR(i.a, x.current_a.a, 1e-9);
  EXPECT_NEAR(i.b, x.current_a.b, 1e-9);
  EXPECT_NEAR(i.c, x.current_a.c, 1e-9);
  EXPECT_NEAR(two.speed_rad_s, x.speed_rad_s, 1e-9);
  EXPECT_NEAR(two.angle_rad, x.angle_rad, 1e-9);
  EXPECT_GT(std::abs(i.a) + std::abs(i.b), 0.1);
}

struct StepperDrive {
  TwoPhase flux_wb{};
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;
};

// A hybrid stepper by its tooth geometry: 50 rotor teeth, flux lambda_M cos and sin(50 theta) of the magnet
// through the phases, torque i·d(flux)/d(theta). Catches: K_m that does not hold n_p, an angle of the shaft
// where the electrical one belongs. In flux linkages the Runge-Kutta steps are others: the steps are so short
// that their errors are below the tolerance.
TEST(PmEquivalence, TheStepperIsThePmMachineWithItsTeethAsPolePairs) {
  constexpr double kTeeth = 50.0;
  constexpr double kFlux_wb = 0.19 / 50.0;
  constexpr double kResistance_ohm = 0.55;
  constexpr double kInductance_h = 1.5e-3;
  constexpr double kInertia_kgm2 = 4.5e-5;
  constexpr double kStep_s = 1e-6;
  constexpr int kSteps = 20'000;
  constexpr TwoPhase kVoltage_v = {.a = -2.0, .b = 3.3};

  const PmMachineConstants c = constants_of({.pole_pairs = 50,
                                             .stator_resistance_ohm = kResistance_ohm,
                                             .inductance_d_h = kInductance_h,
                                             .inductance_q_h = kInductance_h,
                                             .torque_constant_nm_per_a = kTeeth * kFlux_wb});
  const Drive<PmMachine> pm =
      integrated<PmMachine>(c, {}, kInertia_kgm2, kStep_s, kSteps,
                            [&](double) -> TerminalInput { return {.voltage_v = kVoltage_v}; });

  StepperDrive x{.flux_wb = {.a = kFlux_wb, .b = 0.0}};
  const auto current_a = [&](const StepperDrive& y) {
    return TwoPhase{.a = (y.flux_wb.a - kFlux_wb * std::cos(kTeeth * y.angle_rad)) / kInductance_h,
                    .b = (y.flux_wb.b - kFlux_wb * std::sin(kTeeth * y.angle_rad)) / kInductance_h};
  };
  for (int n = 0; n < kSteps; ++n) {
    x = rk4_step(x, kStep_s, [&](const StepperDrive& y) noexcept -> StepperDrive {
      const TwoPhase i = current_a(y);
      const double torque =
          kTeeth * kFlux_wb * (i.b * std::cos(kTeeth * y.angle_rad) - i.a * std::sin(kTeeth * y.angle_rad));
      return {.flux_wb = {kVoltage_v.a - kResistance_ohm * i.a, kVoltage_v.b - kResistance_ohm * i.b},
              .speed_rad_s = torque / kInertia_kgm2,
              .angle_rad = y.speed_rad_s};
    });
  }
  EXPECT_NEAR(pm.machine.i_a_a, current_a(x).a, 1e-9);
  EXPECT_NEAR(pm.machine.i_b_a, current_a(x).b, 1e-9);
  EXPECT_NEAR(pm.angle_rad, x.angle_rad, 1e-9);
  EXPECT_GT(std::abs(x.angle_rad), 0.01);
}

constexpr WoundRotorMachineParameters kWound{.pole_pairs = 2,
                                             .stator_resistance_ohm = 0.7,
                                             .field_resistance_ohm = 5.0,
                                             .stator_inductance_h = 0.02,
                                             .field_inductance_h = 0.9,
                                             .mutual_inductance_h = 0.12,
                                             .star = true};

// SM-01 to SM-02. Catches: n_p missing in the torque or the emf of one of the two.
TEST(PmEquivalence, TheWoundRotorWithItsFieldCurrentHeldIsAPmMachine) {
  constexpr double kField_a = 3.0;
  const WoundRotorMachineConstants wound = constants_of(kWound);
  const PmMachineConstants pm =
      constants_of({.pole_pairs = kWound.pole_pairs,
                    .stator_resistance_ohm = kWound.stator_resistance_ohm,
                    .inductance_d_h = kWound.stator_inductance_h,
                    .inductance_q_h = kWound.stator_inductance_h,
                    .torque_constant_nm_per_a = kWound.pole_pairs * kWound.mutual_inductance_h * kField_a});
  for (double angle = -3.0; angle < 3.0; angle += 0.23) {
    const RotorMotion motion{
        .angle_rad = angle, .speed_rad_s = 60.0 * angle, .electrical = cos_sin(2.0 * angle)};
    for (const Conduction conduction : {Conduction::kFull, Conduction::kLine, Conduction::kNone}) {
      TerminalInput u{.voltage_v = {40.0, -25.0}, .conduction = conduction, .line = {.a = 0.6, .b = 0.8}};
      const PmMachineState x = restricted(pm, {.i_a_a = 5.0, .i_b_a = 9.0}, motion, u);
      const PmMachineState slope = derivative(pm, x, motion, u);
      // The field voltage that a perfect field regulator applies: R_F i_F + M d(i·e)/dt.
      const CosSin e = motion.electrical;
      const double along_field_slope = slope.i_a_a * e.cos + slope.i_b_a * e.sin +
                                       2.0 * motion.speed_rad_s * (x.i_b_a * e.cos - x.i_a_a * e.sin);
      u.field_v = kWound.field_resistance_ohm * kField_a + kWound.mutual_inductance_h * along_field_slope;
      const WoundRotorMachineState y{.i_a_a = x.i_a_a, .i_b_a = x.i_b_a, .i_field_a = kField_a};
      const WoundRotorMachineState wound_slope = derivative(wound, y, motion, u);
      EXPECT_NEAR(wound_slope.i_field_a, 0.0, 1e-10);
      EXPECT_NEAR(wound_slope.i_a_a, slope.i_a_a, 1e-9);
      EXPECT_NEAR(wound_slope.i_b_a, slope.i_b_a, 1e-9);
      EXPECT_NEAR(torque_nm(wound, y, motion), torque_nm(pm, x, motion), 1e-12);
      EXPECT_NEAR(rotor_flux_wb(wound, y, motion).b, rotor_flux_wb(pm, x, motion).b, 1e-15);
      EXPECT_NEAR(open_circuit_voltages(wound, y, motion).stator.a,
                  open_circuit_voltages(pm, x, motion).stator.a, 1e-12);
    }
  }
}

struct Shaft {
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;
};

struct WoundThreePhaseDrive {
  ThreePhase flux_wb{};        ///< of the stator phases
  double field_flux_wb = 0.0;  ///< of rotor phase 1
  Shaft shaft{};
};

struct WoundCurrents {
  ThreePhase stator_a;
  double field_a;  ///< i_f of rotor phase 1; phases 2 and 3 carry -i_f/2
};

WoundCurrents currents_of(const WoundThreePhaseDrive& x) {
  const double e = kWound.pole_pairs * x.shaft.angle_rad;
  const std::array<double, 3> cosines{std::cos(e), std::cos(e - kThird_rad), std::cos(e + kThird_rad)};
  const double sum = x.flux_wb.a * cosines[0] + x.flux_wb.b * cosines[1] + x.flux_wb.c * cosines[2];
  const double m = kWound.mutual_inductance_h;
  const double l_s = kWound.stator_inductance_h;
  // psi_k = L_S i_k + M i_f cos_k;  psi_R1 = L_F i_f + (2/3) M sum of i_k cos_k;  the squares of cos_k add to
  // 3/2.
  const double field_a =
      (x.field_flux_wb - 2.0 / 3.0 * m / l_s * sum) / (kWound.field_inductance_h - m * m / l_s);
  return {.stator_a = {(x.flux_wb.a - m * field_a * cosines[0]) / l_s,
                       (x.flux_wb.b - m * field_a * cosines[1]) / l_s,
                       (x.flux_wb.c - m * field_a * cosines[2]) / l_s},
          .field_a = field_a};
}

// WR3-01 in phase quantities and flux linkages. Catches: sqrt(3/2) of the field current lost or applied to
// R_F or M, a field that does not see the stator. Here too the steps are so short that only rounding is left.
TEST(PmEquivalence, TheThreePhaseWoundRotorMovesAsItsTwoPhaseEquivalent) {
  constexpr double kInertia_kgm2 = 5e-3;
  constexpr double kStep_s = 2e-6;
  constexpr int kSteps = 20'000;
  constexpr double kRotorPhase_v = 10.0;  // u_R1
  const double root = std::sqrt(1.5);

  const Drive<WoundRotorMachine> start{
      .machine = {.i_field_a = root * 2.0}, .speed_rad_s = 150.0, .angle_rad = 0.4};
  const Drive<WoundRotorMachine> two = integrated<WoundRotorMachine>(
      constants_of(kWound), start, kInertia_kgm2, kStep_s, kSteps, [&](double time_s) -> TerminalInput {
        return {.voltage_v = three_to_two(unbalanced_v(time_s)), .field_v = root * kRotorPhase_v};
      });

  WoundThreePhaseDrive x{.shaft = {.speed_rad_s = 150.0, .angle_rad = 0.4}};
  const double flux_wb = kWound.mutual_inductance_h * 2.0;
  x.flux_wb = {flux_wb * std::cos(0.8), flux_wb * std::cos(0.8 - kThird_rad),
               flux_wb * std::cos(0.8 + kThird_rad)};
  x.field_flux_wb = kWound.field_inductance_h * 2.0;
  for (int n = 0; n < kSteps; ++n) {
    const std::array<double, 3> u = of_windings(unbalanced_v(n * kStep_s));
    x = rk4_step(x, kStep_s, [&](const WoundThreePhaseDrive& y) noexcept -> WoundThreePhaseDrive {
      const WoundCurrents i = currents_of(y);
      const double e = kWound.pole_pairs * y.shaft.angle_rad;
      const double torque = -kWound.pole_pairs * kWound.mutual_inductance_h * i.field_a *
                            (i.stator_a.a * std::sin(e) + i.stator_a.b * std::sin(e - kThird_rad) +
                             i.stator_a.c * std::sin(e + kThird_rad));
      const double r = kWound.stator_resistance_ohm;
      return {.flux_wb = {u[0] - r * i.stator_a.a, u[1] - r * i.stator_a.b, u[2] - r * i.stator_a.c},
              .field_flux_wb = kRotorPhase_v - kWound.field_resistance_ohm * i.field_a,
              .shaft = {.speed_rad_s = torque / kInertia_kgm2, .angle_rad = y.shaft.speed_rad_s}};
    });
  }
  const WoundCurrents expected = currents_of(x);
  const ThreePhase i = two_to_three({two.machine.i_a_a, two.machine.i_b_a});
  EXPECT_NEAR(i.a, expected.stator_a.a, 1e-9);
  EXPECT_NEAR(i.b, expected.stator_a.b, 1e-9);
  EXPECT_NEAR(i.c, expected.stator_a.c, 1e-9);
  EXPECT_NEAR(two.machine.i_field_a, root * expected.field_a, 1e-9);
  EXPECT_NEAR(two.speed_rad_s, x.shaft.speed_rad_s, 1e-9);
  EXPECT_GT(std::abs(expected.field_a - 2.0), 0.01);
}

}  // namespace
}  // namespace drivebench::pm_equivalence_test
