#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "plant/machines/pm/pm_machine.hpp"
#include "tests/plant/power_balance.hpp"

/// The PM machine as a hybrid stepping motor, with inertia and friction of its own.
namespace drivebench::pm_stepper_test {
namespace {

constexpr PmMachineParameters kStepper{.pole_pairs = 50,
                                       .stator_resistance_ohm = 0.55,
                                       .inductance_d_h = 1.5e-3,
                                       .inductance_q_h = 1.5e-3,
                                       .torque_constant_nm_per_a = 0.19};
constexpr double kStepperInertia_kgm2 = 4.5e-5;
constexpr double kStepperFriction_nms = 8e-4;

constexpr double kRadPerDegree = std::numbers::pi / 180.0;

struct Drive {
  PmMachineState machine{};
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;
};

Drive advanced_drive(const PmMachineConstants& c, Drive x, const TerminalInput& u, double duration_s) {
  constexpr double kStep_s = 50e-6;
  for (int left = static_cast<int>(std::lround(duration_s / kStep_s)); left > 0; --left) {
    x = rk4_step(x, kStep_s, [&](const Drive& y) noexcept -> Drive {
      const RotorMotion motion = motion_at(c, y.angle_rad, y.speed_rad_s);
      const double net_nm = torque_nm(c, y.machine, motion) - kStepperFriction_nms * y.speed_rad_s;
      return {.machine = derivative(c, y.machine, motion, u),
              .speed_rad_s = net_nm / kStepperInertia_kgm2,
              .angle_rad = y.speed_rad_s};
    });
  }
  return x;
}

// Catches: a line that lets a little of the other direction through from step to step; an open stator in
// which a current builds up while the rotor turns.
TEST(PmStepper, CurrentsOfOpenPhasesStayExactlyZeroWhileTheRotorTurns) {
  for (const double inductance_q_h : {1.5e-3, 2.5e-3}) {
    PmMachineParameters parameters = kStepper;
    parameters.inductance_q_h = inductance_q_h;
    const PmMachineConstants c = constants_of(parameters);
    const TerminalInput line{
        .voltage_v = {20.0, 7.0}, .conduction = Conduction::kLine, .line = {.a = 1.0, .b = 0.0}};
    const Drive after = advanced_drive(c, {.machine = {1.0, 0.0}, .speed_rad_s = 100.0}, line, 0.01);
    EXPECT_NE(after.machine.i_a_a, 1.0);
    EXPECT_EQ(after.machine.i_b_a, 0.0);
    const TerminalInput open{.voltage_v = {20.0, 7.0}, .conduction = Conduction::kNone};
    const Drive idle = advanced_drive(c, {.speed_rad_s = 100.0}, open, 0.01);
    EXPECT_EQ(idle.machine.i_a_a, 0.0);
    EXPECT_EQ(idle.machine.i_b_a, 0.0);
    EXPECT_LT(idle.speed_rad_s, 100.0);
  }
}

/// Goes through the voltages, 0.7 s for each, and expects the rotor one step further each time.
void expect_steps(const PmMachineParameters& parameters, std::span<const TwoPhase> voltages,
                  double step_degrees) {
  const PmMachineConstants c = constants_of(parameters);
  Drive x;
  for (std::size_t n = 0; n < voltages.size(); ++n) {
    x = advanced_drive(c, x, {.voltage_v = voltages[n]}, 0.7);
    // By then the swing has died down to less than this.
    EXPECT_NEAR(x.angle_rad / kRadPerDegree, static_cast<double>(n) * step_degrees, 1e-6) << "step " << n;
  }
}

// ST-01. Catches: torque or emf without n_p in the angle; a detent torque with another period or sign than
// four stable places in an electrical turn.
TEST(PmStepper, AStepperGoes1Point8DegreesInAFullStepWithAndWithoutDetentTorque) {
  constexpr auto kVoltages =
      std::to_array<TwoPhase>({{1.1, 0.0}, {0.0, 1.1}, {-1.1, 0.0}, {0.0, -1.1}, {1.1, 0.0}});
  expect_steps(kStepper, kVoltages, 1.8);
  PmMachineParameters with_detent = kStepper;
  with_detent.detent_torque_nm = 0.02;
  expect_steps(with_detent, kVoltages, 1.8);
  PmMachineParameters five_teeth = kStepper;
  five_teeth.pole_pairs = 5;
  expect_steps(five_teeth, kVoltages, 18.0);
}

// ST-03. Catches: phases of different strength, which full steps do not show.
TEST(PmStepper, AStepperGoes0Point9DegreesInAHalfStep) {
  constexpr auto kVoltages = std::to_array<TwoPhase>({{1.1, 0.0},
                                                      {1.1, 1.1},
                                                      {0.0, 1.1},
                                                      {-1.1, 1.1},
                                                      {-1.1, 0.0},
                                                      {-1.1, -1.1},
                                                      {0.0, -1.1},
                                                      {1.1, -1.1},
                                                      {1.1, 0.0}});
  expect_steps(kStepper, kVoltages, 0.9);
}

// Catches: a detent torque of the wrong sign or period. Without current the rotor goes to the nearest full
// step.
TEST(PmStepper, DetentTorqueHoldsTheRotorAtTheFullSteps) {
  PmMachineParameters parameters = kStepper;
  parameters.detent_torque_nm = 0.02;
  const PmMachineConstants c = constants_of(parameters);
  for (const double start_degrees : {-1.0, -0.8, 0.8, 1.0, 2.6}) {
    const Drive x = advanced_drive(c, {.angle_rad = start_degrees * kRadPerDegree},
                                   {.conduction = Conduction::kNone}, 4.0);
    EXPECT_NEAR(x.angle_rad / kRadPerDegree, 1.8 * std::round(start_degrees / 1.8), 1e-6);
  }
}

// Case 33, a held current of 1 A in phase b with the rotor at phase a: peak of 3.460 degrees at 7.96 ms.
// Catches: a wrong factor of the torque, which the rest positions do not show.
TEST(PmStepper, AStepperOnAHeldCurrentOvershootsAsInTheReference) {
  const PmMachineConstants c = constants_of(kStepper);
  struct Shaft {
    double speed_rad_s;
    double angle_rad;
  };
  constexpr double kStep_s = 10e-6;
  Shaft x{0.0, 0.0};
  double time_s = 0.0;
  do {
    x = rk4_step(x, kStep_s, [&](const Shaft& y) noexcept -> Shaft {
      const double net_nm = torque_nm(c, {0.0, 1.0}, motion_at(c, y.angle_rad, y.speed_rad_s)) -
                            kStepperFriction_nms * y.speed_rad_s;
      return {net_nm / kStepperInertia_kgm2, y.speed_rad_s};
    });
    time_s += kStep_s;
  } while (x.speed_rad_s > 0.0 && time_s < 0.1);
  EXPECT_NEAR(x.angle_rad / kRadPerDegree, 3.460, 0.001);
  EXPECT_NEAR(time_s, 7.96e-3, 0.01e-3);
}

/// Steps that the rotor has made after 40 full steps at this rate, from rest with phase a on.
double steps_made(double voltage_v, double steps_per_s) {
  const PmMachineConstants c = constants_of(kStepper);
  const std::array<TwoPhase, 4> voltages{
      {{voltage_v, 0.0}, {0.0, voltage_v}, {-voltage_v, 0.0}, {0.0, -voltage_v}}};
  Drive x{.machine = {voltage_v / kStepper.stator_resistance_ohm, 0.0}};
  for (std::size_t n = 1; n <= 40; ++n)
    x = advanced_drive(c, x, {.voltage_v = voltages[n % 4]}, 1.0 / steps_per_s);
  x = advanced_drive(c, x, {.voltage_v = voltages[0]}, 1.0);
  return x.angle_rad / (1.8 * kRadPerDegree);
}

// ST-04 and case 34: a rotor that falls out of step loses whole electrical turns, four steps each. Catches: a
// back emf that does not brake, and an integration whose error adds up over the steps.
TEST(PmStepper, TooFastAStepperLosesFourStepsAtATime) {
  EXPECT_NEAR(steps_made(1.1, 200.0), 40.0, 1e-6);
  EXPECT_NEAR(steps_made(1.1, 300.0), 8.0, 1e-6);
  EXPECT_NEAR(steps_made(1.1, 400.0), 4.0, 1e-6);
  EXPECT_NEAR(steps_made(1.1, 600.0), 0.0, 1e-6);
  EXPECT_NEAR(steps_made(3.3, 400.0), 40.0, 1e-6);
  EXPECT_NEAR(steps_made(3.3, 600.0), 4.0, 1e-6);
}

}  // namespace
}  // namespace drivebench::pm_stepper_test
