#include "clients/control/induction/induction_drive.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "clients/control/math/wrapped.hpp"
#include "plant/math/unbounded.hpp"
#include "tests/clients/control/induction/servo_drive.hpp"

namespace drivebench::control::induction_drive_test {
namespace {

constexpr double kPeriod_s = 125e-6;
constexpr double kRadPerCount = 2.0 * std::numbers::pi / 2000.0;

// Catches: parameters with which σ is not positive, and a rule that names no gain.
TEST(InductionDrive, LeakageMustBePositive) {
  EXPECT_TRUE(kServoDrive.problems().empty());
  InductionDriveParameters p = kServoDrive;
  p.motor.machine.mutual_inductance_h = 0.015;
  ASSERT_EQ(p.problems().size(), 1U);
  EXPECT_EQ(p.problems()[0].substr(0, 27), "machine.mutual_inductance_h");
}

// Catches: angles that count from anywhere but the first sample, at counts that a double cannot hold.
TEST(InductionFeedback, TheFirstSampleIsAngleZero) {
  constexpr std::int64_t kFar = -9'007'199'254'740'993;
  InductionFeedback feedback(kServoDrive);
  EXPECT_EQ(feedback.sample({.encoder_count = kFar}, 1).angle_rad, 0.0);
  EXPECT_NEAR(feedback.sample({.encoder_count = kFar + 3}, 1).angle_rad, 3.0 * kRadPerCount, 1e-15);
}

// Catches: observers that stand still over lost samples: 70 rad/s for five periods a gap, as with every
// sample.
TEST(InductionFeedback, LostSamplesAreBridged) {
  const auto state_after = [](std::int64_t stride, auto feedback) {
    for (std::int64_t k = 0; k <= 800; k += k < 400 ? 1 : stride) {
      const double angle_rad = 70.0 * kPeriod_s * static_cast<double>(k);
      const TwoPhase i = to_ab({.d = 4.0, .q = 0.0}, cos_sin_unbounded(3.0 * angle_rad));
      feedback.sample({.encoder_count = std::llround(angle_rad / kRadPerCount), .i_a_a = i.a, .i_b_a = i.b},
                      k <= 400 ? 1 : stride);
    }
    return feedback.state();
  };
  const auto expect_alike = [](const InductionState& a, const InductionState& b) {
    EXPECT_NEAR(a.speed_rad_s, b.speed_rad_s, 2.0);
    EXPECT_NEAR(wrapped(a.flux_angle_rad - b.flux_angle_rad), 0.0, 0.05);
    EXPECT_NEAR(a.flux_wb, 0.0468, 5e-4);
    EXPECT_NEAR(b.flux_wb, 0.0468, 5e-4);
  };
  expect_alike(state_after(1, InductionFeedback(kServoDrive)),
               state_after(5, InductionFeedback(kServoDrive)));
  expect_alike(state_after(1, LoadedInductionFeedback(kServoDrive, 300.0)),
               state_after(5, LoadedInductionFeedback(kServoDrive, 300.0)));
}

// Catches: the bias of an observer that knows no load, and its absence where the load is observed: a motor
// that holds 0.25 N·m at rest looks to the one as if it turned at (l1/l2)·τ_L/J = 5.1 rad/s.
TEST(LoadedInductionFeedback, SpeedIsNotBiasedByALoad) {
  InductionFeedback plain(kServoDrive);
  LoadedInductionFeedback loaded(kServoDrive, 300.0);
  const InductionMachineModel& m = kServoMotor.machine;
  const double flux_wb = 0.0117 * 4.0;
  const double i_q_a = 0.25 / (m.inertia_kgm2 * m.acceleration_per_wb_a() * flux_wb);
  for (int k = 0; k < 4000; ++k) {
    // The current lies where each observer has its flux, so that both see the same torque.
    const auto currents = [&](const InductionState& x) {
      const TwoPhase i = to_ab({.d = 4.0, .q = k < 800 ? 0.0 : i_q_a}, cos_sin_unbounded(x.flux_angle_rad));
      return Measurement{.i_a_a = i.a, .i_b_a = i.b};
    };
    plain.sample(currents(plain.state()), 1);
    loaded.sample(currents(loaded.state()), 1);
  }
  EXPECT_NEAR(plain.state().speed_rad_s, 1.8e3 / 8e5 * loaded.load_nm() / m.inertia_kgm2, 0.1);
  EXPECT_NEAR(loaded.state().speed_rad_s, 0.0, 0.05);
  EXPECT_NEAR(loaded.load_nm(), 0.25, 0.01);  // the current is a sample behind its flux, a degree
}

// Catches: a clip that forgets that an earlier one had already hit.
TEST(Clipped, KeepsTheReportOfAnEarlierLimit) {
  bool at_limit = false;
  EXPECT_EQ(clipped(-3.0, 2.0, at_limit), -2.0);
  EXPECT_EQ(clipped(1.0, 2.0, at_limit), 1.0);
  EXPECT_TRUE(at_limit);
}

}  // namespace
}  // namespace drivebench::control::induction_drive_test
