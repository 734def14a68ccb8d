#include "clients/control/moves/trajectory.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace drivebench::control::trajectory_test {
namespace {

constexpr TrajectoryParameters kProfileA = {
    .distance_rad = std::numbers::pi, .ramp_up_s = 0.030, .cruise_s = 0.013, .ramp_down_s = 0.030};
constexpr TrajectoryParameters kUnequalRamps = {
    .distance_rad = -7.0, .ramp_up_s = 0.2, .cruise_s = 0.05, .ramp_down_s = 0.4};

// Catches: ω_max = θ_f/t1 (the printed misprint) and a wrong c1 or c2.
TEST(Trajectory, ProfileAHasThePeaksOfTheTable) {
  EXPECT_NEAR(kProfileA.duration_s(), 0.073, 1e-15);
  EXPECT_NEAR(kProfileA.max_speed_rad_s(), 73.06, 0.005);
  const Reference middle_of_ramp = trajectory_at(kProfileA, 0.015);
  EXPECT_NEAR(middle_of_ramp.acceleration_rad_s2, 3653.0, 0.5);
  EXPECT_NEAR(middle_of_ramp.acceleration_rad_s2, 1.5 * kProfileA.max_speed_rad_s() / 0.030, 1e-9);
  EXPECT_NEAR(middle_of_ramp.speed_rad_s, 0.5 * kProfileA.max_speed_rad_s(), 1e-12);
  EXPECT_NEAR(trajectory_at(kProfileA, 0.058).acceleration_rad_s2, -3653.0, 0.5);
  EXPECT_NEAR(trajectory_at(kProfileA, 0.0).jerk_rad_s3, 6.0 * kProfileA.max_speed_rad_s() / (0.030 * 0.030),
              1e-6);
  EXPECT_NEAR(trajectory_at(kProfileA, 0.030).angle_rad, 0.5 * kProfileA.max_speed_rad_s() * 0.030, 1e-14);
}

// Catches: an end that is off by the rounding of three pieces, and a reference that moves on after the end.
TEST(Trajectory, RestsAtZeroBeforeAndExactlyAtTheDistanceAfter) {
  for (const TrajectoryParameters& p : {kProfileA, kUnequalRamps}) {
    for (const double t_s : {-1.0, 0.0}) {
      EXPECT_EQ(trajectory_at(p, t_s).angle_rad, 0.0);
      EXPECT_EQ(trajectory_at(p, t_s).speed_rad_s, 0.0);
      EXPECT_EQ(trajectory_at(p, t_s).acceleration_rad_s2, 0.0);
    }
    const Reference end = trajectory_at(p, p.duration_s() + 1.0);
    EXPECT_EQ(end.angle_rad, p.distance_rad);
    EXPECT_EQ(end.speed_rad_s, 0.0);
    EXPECT_EQ(end.acceleration_rad_s2, 0.0);
    EXPECT_EQ(end.jerk_rad_s3, 0.0);
  }
}

// Catches: a wrong sign in the mirrored ramp: each column must be the derivative of the one before it, across
// the joints too. A central difference over 2·10 µs errs by |x'''|·h²/6; the jerk steps at the joints, which
// the last tolerance leaves out.
TEST(Trajectory, EveryColumnIsTheDerivativeOfTheOneBeforeIt) {
  for (const TrajectoryParameters& p : {kProfileA, kUnequalRamps}) {
    const double h_s = 1e-5;
    const double jerk_scale = 6.0 * std::abs(p.max_speed_rad_s()) / (0.03 * 0.03);
    for (int i = 1; i < 997; ++i) {
      const double t_s = p.duration_s() * i / 997.0;
      const Reference before = trajectory_at(p, t_s - h_s);
      const Reference now = trajectory_at(p, t_s);
      const Reference after = trajectory_at(p, t_s + h_s);
      EXPECT_NEAR((after.angle_rad - before.angle_rad) / (2.0 * h_s), now.speed_rad_s,
                  jerk_scale * h_s * h_s);
      EXPECT_NEAR((after.speed_rad_s - before.speed_rad_s) / (2.0 * h_s), now.acceleration_rad_s2,
                  jerk_scale * h_s);
      const bool across_a_joint =
          before.jerk_rad_s3 * after.jerk_rad_s3 == 0.0 && before.jerk_rad_s3 != after.jerk_rad_s3;
      if (!across_a_joint) {
        EXPECT_NEAR((after.acceleration_rad_s2 - before.acceleration_rad_s2) / (2.0 * h_s), now.jerk_rad_s3,
                    1e-6 * jerk_scale);
      }
    }
  }
}

// Catches: a check that stops at the first problem, and one that NaN passes.
TEST(Trajectory, NamesEveryProblemAtOnce) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(kProfileA.problems().empty());
  EXPECT_EQ((TrajectoryParameters{kNan, 0.0, -1.0, kNan}.problems().size()), 4U);
}

}  // namespace
}  // namespace drivebench::control::trajectory_test
