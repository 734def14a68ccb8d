#include "clients/control/synchronous/two_motor_controller.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "clients/control/presets/presets.hpp"

namespace drivebench::control::two_motor_controller_test {
namespace {

double across(const TwoPhase& u, double angle_rad) {
  return -u.a * std::sin(angle_rad) + u.b * std::cos(angle_rad);
}

// Catches: the inverse of another matrix, angles exchanged, a sign of the sines.
TEST(TwoMotors, TheVoltagesHaveTheWantedComponents) {
  for (const double first : {0.0, 0.7, 2.9}) {
    for (const double apart : {0.1, 1.2, -2.0, 3.0}) {
      const std::array<double, 2> wanted{1.3, -0.4};
      const TwoPhase u = voltages_across({first, first + apart}, wanted, 0.0);
      EXPECT_NEAR(across(u, first), wanted[0], 1e-12);
      EXPECT_NEAR(across(u, first + apart), wanted[1], 1e-12);
    }
  }
}

// On one line the nearest voltages give both the mean, and half a turn apart half the difference. Catches: a
// damping that is not that of the least squares, an inverse that explodes at the determinant 0.
TEST(TwoMotors, AtTheDeterminantZeroTheNearestVoltagesAreGiven) {
  constexpr double kDamping = 1e-3;
  const TwoPhase same = voltages_across({0.4, 0.4}, {1.0, 3.0}, kDamping);
  EXPECT_NEAR(across(same, 0.4), 2.0, 1e-5);
  const TwoPhase opposite = voltages_across({0.4, 0.4 + M_PI}, {1.0, 3.0}, kDamping);
  EXPECT_NEAR(across(opposite, 0.4), -1.0, 1e-5);
  const TwoPhase damped = voltages_across({0.4, 0.4}, {1.0, 1.0}, 1.0);
  EXPECT_NEAR(across(damped, 0.4), 2.0 / 3.0, 1e-12) << "2 v/(2 + d^2)";
}

// Catches: speed and acceleration of the second rotor that are not the derivatives of its angle.
TEST(TwoMotors, TheSecondFallsBackSmoothlyWhileTheFirstTurns) {
  constexpr FallBack kBack{.distance_rad = 0.06, .from_rad = 0.5, .over_rad = 0.4};
  const auto first_at = [](double t) {
    return Reference{
        .angle_rad = 4.0 * t + 3.0 * t * t, .speed_rad_s = 4.0 + 6.0 * t, .acceleration_rad_s2 = 6.0};
  };
  constexpr double kStep = 1e-5;
  for (double t = 0.0; t < 0.3; t += 0.01) {
    const Reference now = kBack.behind(first_at(t));
    const Reference before = kBack.behind(first_at(t - kStep));
    const Reference after = kBack.behind(first_at(t + kStep));
    EXPECT_NEAR(now.speed_rad_s, (after.angle_rad - before.angle_rad) / (2.0 * kStep), 1e-4) << t;
    EXPECT_NEAR(now.acceleration_rad_s2, (after.speed_rad_s - before.speed_rad_s) / (2.0 * kStep), 2e-2) << t;
  }
  EXPECT_EQ(kBack.behind(first_at(0.05)).angle_rad, first_at(0.05).angle_rad);
  EXPECT_NEAR(kBack.behind(first_at(0.3)).angle_rad, first_at(0.3).angle_rad - 0.06, 1e-12);
}

// Catches: voltages before the rotors rest, a start angle of the second that is taken while it still moves.
TEST(TwoMotors, NothingIsCommandedWhileTheRotorsComeToRest) {
  control::Run run = find_preset("exercise/9.9")->make({});
  for (int k = 0; k < 1500; ++k) {
    const Setpoint u = run.step({.second = {.encoder_count = k < 200 ? k : 200}});
    ASSERT_EQ(u.a, 0.0);
    ASSERT_EQ(u.b, 0.0);
  }
  const Setpoint u = run.step({.second = {.encoder_count = 200}});
  EXPECT_NEAR(std::hypot(u.a, u.b), 0.0, 1e-9) << "at rest where both shall be";
}

}  // namespace
}  // namespace drivebench::control::two_motor_controller_test
