#include "clients/control/synchronous/stepper_controller.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "clients/control/moves/speed_steps.hpp"
#include "clients/control/moves/step_train.hpp"

namespace drivebench::control::stepper_controller_test {
namespace {

constexpr double kQuarter_rad = 0.5 * std::numbers::pi;

// ST-01, ST-03. Catches: a sequence in the other direction, and two phases on at a full step: the vector of
// the pattern points at the angle where the rotor rests, with a length of 1, or √2 with two phases on.
TEST(StepPattern, PointsWhereTheRotorRests) {
  const auto expect_at = [](TwoPhase x, double angle_rad, double length) {
    EXPECT_NEAR(x.a, length * std::cos(angle_rad), 1e-12) << angle_rad;
    EXPECT_NEAR(x.b, length * std::sin(angle_rad), 1e-12) << angle_rad;
  };
  for (int n = -9; n <= 9; ++n) {
    expect_at(step_pattern(StepMode::kFull, 1.0, n * kQuarter_rad), n * kQuarter_rad, 1.0);
    const bool two_on = n % 2 != 0;
    expect_at(step_pattern(StepMode::kHalf, 1.0, 0.5 * n * kQuarter_rad), 0.5 * n * kQuarter_rad,
              two_on ? std::numbers::sqrt2 : 1.0);
    expect_at(step_pattern(StepMode::kMicro, 16.0, n * kQuarter_rad / 16.0), n * kQuarter_rad / 16.0, 1.0);
  }
  // Between steps: the nearest one.
  expect_at(step_pattern(StepMode::kFull, 1.0, 0.4 * kQuarter_rad), 0.0, 1.0);
  expect_at(step_pattern(StepMode::kMicro, 4.0, 0.13 * kQuarter_rad), 0.25 * kQuarter_rad, 1.0);
}

// Catches: a step counted twice or never by the rounding of a sample time, and a train that goes on.
TEST(StepTrain, TakesItsFirstStepAtOnceAndStopsAtTheLast) {
  const StepTrain train({.step_rad = 0.1, .steps = 3.0, .rate_hz = 10.0});
  EXPECT_EQ(train.at(-1e-6).angle_rad, 0.0);
  EXPECT_NEAR(train.at(0.0).angle_rad, 0.1, 1e-15);
  EXPECT_NEAR(train.at(0.0999).angle_rad, 0.1, 1e-15);
  EXPECT_NEAR(train.at(0.1 - 1e-17).angle_rad, 0.2, 1e-15);
  EXPECT_NEAR(train.at(5.0).angle_rad, 0.3, 1e-15);
  EXPECT_NEAR(train.duration_s(), 0.3, 1e-15);
  EXPECT_EQ((StepTrainParameters{.step_rad = 0.1, .steps = 2.5, .rate_hz = 1.0}).problems().size(), 1u);
}

// Catches: an angle that jumps where the speed does.
TEST(SpeedSteps, HaveTheAngleOfTheirSpeeds) {
  const SpeedSteps steps({.first_rad_s = 100.0, .first_s = 0.5, .second_rad_s = -20.0, .second_s = 1.0});
  EXPECT_EQ(steps.at(-1e-9).speed_rad_s, 0.0);
  EXPECT_EQ(steps.at(0.0).speed_rad_s, 100.0);
  EXPECT_NEAR(steps.at(0.25).angle_rad, 25.0, 1e-12);
  EXPECT_EQ(steps.at(0.5).speed_rad_s, -20.0);
  EXPECT_NEAR(steps.at(0.5).angle_rad, 50.0, 1e-12);
  EXPECT_NEAR(steps.at(1.0).angle_rad, 40.0, 1e-12);
  EXPECT_NEAR(steps.duration_s(), 1.5, 1e-12);
}

// Catches: a run that throws the rotor to another full step when it begins: 30 counts are 1.5 electrical
// turns and 270 degrees further is where the magnet stands.
TEST(StepperController, StartsAtTheStepWhereTheRotorStands) {
  const StepperParameters p = {
      .pole_pairs = 50.0, .sample_rate_hz = 1e4, .counts_per_revolution = 2000.0, .amplitude = 3.0};
  StepperController controller(p);
  const Setpoint first = controller.update({.encoder_count = 31}, {}, 1);  // 279 electrical degrees
  EXPECT_NEAR(first.a, 0.0, 1e-12);
  EXPECT_NEAR(first.b, -3.0, 1e-12);
  const Setpoint next = controller.update({.encoder_count = 31}, {.angle_rad = p.step_rad()}, 1);
  EXPECT_NEAR(next.a, 3.0, 1e-12);
  EXPECT_NEAR(next.b, 0.0, 1e-12);
  EXPECT_EQ(controller.angle_rad(), 0.0);
}

}  // namespace
}  // namespace drivebench::control::stepper_controller_test
