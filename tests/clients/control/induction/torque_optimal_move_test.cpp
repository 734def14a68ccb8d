#include "clients/control/induction/torque_optimal_move.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control::torque_optimal_move_test {
namespace {

constexpr TorqueMoveParameters kBookMove = {
    .top_speed_rad_s = rad_s(8000.0), .run_up_s = 0.38, .run_down_s = 0.265, .torque_ramp_s = 0.030};

const OptimumTorqueTable& optimum() {
  static const OptimumTorqueTable kTable(SteadyInductionModel::of(kServoMotor),
                                         {.voltage_v = 80.0, .current_a = 6.0}, rad_s(8000.0));
  return kTable;
}

InductionMachineModel with_friction(double friction_nms) {
  InductionMachineModel m = kServoMotor.machine;
  m.friction_nms = friction_nms;
  return m;
}

// Catches: an inertia or a torque table that is off: the shares 0.892 and 0.768 and the 312.4 rad of the
// reference, to its last digit.
TEST(TorqueOptimalMove, TakesTheSharesOfTheReference) {
  const TorqueOptimalMove move(kBookMove, optimum(), with_friction(0.0));
  EXPECT_NEAR(move.motoring_share(), 0.892, 0.001);
  EXPECT_NEAR(move.generating_share(), 0.768, 0.001);
  EXPECT_NEAR(move.at(0.645).angle_rad, 312.4, 0.06);
  EXPECT_NEAR(move.at(0.38).speed_rad_s, rad_s(8000.0), 1e-6);
  EXPECT_NEAR(move.duration_s(), 0.645, 1e-12);
}

// Catches: a jump at the joints or at the end: before 0 and after the end nothing moves.
TEST(TorqueOptimalMove, RestsBeforeAndAfter) {
  const TorqueOptimalMove move(kBookMove, optimum(), with_friction(0.0));
  EXPECT_EQ(move.at(-0.1).speed_rad_s, 0.0);
  EXPECT_EQ(move.at(0.0).acceleration_rad_s2, 0.0);
  const Reference end = move.at(10.0);
  EXPECT_EQ(end.speed_rad_s, 0.0);
  EXPECT_EQ(end.acceleration_rad_s2, 0.0);
  EXPECT_NEAR(move.at(0.645 - 1e-6).angle_rad, end.angle_rad, 1e-6);
  EXPECT_NEAR(move.at(0.645 - 1e-6).speed_rad_s, 0.0, 1e-6);
}

// Catches: a wrong coefficient of the quintic: each column is the derivative of the one before it, within and
// across the steps of 0.5 ms. A central difference over 2·10 µs errs by |x'''|·h²/6.
TEST(TorqueOptimalMove, EveryColumnIsTheDerivativeOfTheOneBeforeIt) {
  const TorqueOptimalMove move(kBookMove, optimum(), with_friction(6e-5));
  const double h_s = 1e-5;
  for (int i = 1; i < 1999; ++i) {
    const double t_s = 0.645 * i / 1999.0;
    const Reference before = move.at(t_s - h_s);
    const Reference now = move.at(t_s);
    const Reference after = move.at(t_s + h_s);
    EXPECT_NEAR((after.angle_rad - before.angle_rad) / (2.0 * h_s), now.speed_rad_s, 1e-5) << t_s;
    EXPECT_NEAR((after.speed_rad_s - before.speed_rad_s) / (2.0 * h_s), now.acceleration_rad_s2, 2.0) << t_s;
  }
}

// Catches: friction with the wrong sign or left out: amid a phase the torque is the share of the optimum.
TEST(TorqueOptimalMove, TorqueIsTheShareOfTheOptimumPlusFriction) {
  const InductionMachineModel machine = with_friction(6e-5);
  const TorqueOptimalMove move(kBookMove, optimum(), machine);
  for (const double t_s : {0.05, 0.2, 0.34, 0.45, 0.6}) {
    const Reference r = move.at(t_s);
    const bool up = t_s < 0.38;
    const double torque_nm =
        machine.inertia_kgm2 * r.acceleration_rad_s2 + machine.friction_nms * r.speed_rad_s;
    const double share = up ? move.motoring_share() : move.generating_share();
    const TorqueSign sign = up ? TorqueSign::kMotoring : TorqueSign::kGenerating;
    EXPECT_NEAR(torque_nm, share * optimum().at(r.speed_rad_s, sign).torque_nm, 1e-5) << t_s;
  }
  EXPECT_GT(move.motoring_share(),
            TorqueOptimalMove(kBookMove, optimum(), with_friction(0.0)).motoring_share());
}

// Case 11. Catches: a move that hides its infeasibility: with the listed friction 0.38 s need more than the
// optimum torque, and no torque within reason makes it in 50 ms.
TEST(TorqueOptimalMove, ListedFrictionNeedsMoreThanTheOptimum) {
  const TorqueOptimalMove move(kBookMove, optimum(), kServoMotor.machine);
  EXPECT_GT(move.motoring_share(), 1.05);
  TorqueMoveParameters sudden = kBookMove;
  sudden.run_up_s = 0.06;
  EXPECT_THROW(TorqueOptimalMove(sudden, optimum(), kServoMotor.machine), std::invalid_argument);
}

// Catches: a ramp longer than half a phase, which would never reach its torque.
TEST(TorqueOptimalMove, RampsMustFit) {
  EXPECT_TRUE(kBookMove.problems().empty());
  TorqueMoveParameters p = kBookMove;
  p.torque_ramp_s = 0.14;
  ASSERT_EQ(p.problems().size(), 1U);
  EXPECT_EQ(p.problems()[0], "move.torque_ramp_s must fit twice into either phase");
}

}  // namespace
}  // namespace drivebench::control::torque_optimal_move_test
