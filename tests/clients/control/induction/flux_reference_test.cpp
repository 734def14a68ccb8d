#include "clients/control/induction/flux_reference.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/clients/control/induction/limit_speeds.hpp"
#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control::flux_reference_test {
namespace {

constexpr double kPeriod_s = 250e-6;
constexpr double kRatedFluxWb = 0.0117 * 5.5 / std::numbers::sqrt2;
constexpr FluxReferenceParameters kWeakening = {
    .rated_flux_wb = kRatedFluxWb, .base_speed_rad_s = 250.0, .policy = FluxPolicy::kFieldWeakening};

FluxTarget target(const FluxReferenceParameters& p, const Reference& r) {
  return FluxReference(p, kServoMotor.machine, kPeriod_s).step(r);
}

// Catches: an exchanged L_R/M: 586 and 701 rad/s at 80 V, 439 and 526 at 60 V.
TEST(FluxReference, BaseSpeedsOfBookAndSlides) {
  const InductionMachineModel& m = kServoMotor.machine;
  EXPECT_NEAR(base_speed_of_book_rad_s(m, kRatedFluxWb, 80.0), 586.0, 1.0);
  EXPECT_NEAR(base_speed_of_slides_rad_s(m, kRatedFluxWb, 80.0), 701.0, 1.0);
  EXPECT_NEAR(base_speed_of_book_rad_s(m, kRatedFluxWb, 60.0), 439.0, 1.0);
  EXPECT_NEAR(base_speed_of_slides_rad_s(m, kRatedFluxWb, 60.0), 526.0, 1.0);
}

// Catches: a flux that weakens at one sign of the speed only, or that jumps at the base speed.
TEST(FluxReference, WeakeningKeepsSpeedTimesFlux) {
  EXPECT_EQ(target(kWeakening, {.speed_rad_s = 249.9}).flux_wb, kRatedFluxWb);
  EXPECT_NEAR(target(kWeakening, {.speed_rad_s = 250.001}).flux_wb, kRatedFluxWb, 1e-6);
  for (const double speed_rad_s : {500.0, -838.0}) {
    EXPECT_NEAR(target(kWeakening, {.speed_rad_s = speed_rad_s}).flux_wb * std::abs(speed_rad_s),
                250.0 * kRatedFluxWb, 1e-12);
  }
}

// Catches: a wrong sign in a derivative, or a feed-forward that forgets that a falling flux needs less than
// ψ/M: against differences along a cubic speed, which err by its fourth derivative.
TEST(FluxReference, RatesOfWeakeningAreItsDerivatives) {
  const auto at = [](double t_s) {
    return Reference{.speed_rad_s = -300.0 - 900.0 * t_s + 4e3 * t_s * t_s,
                     .acceleration_rad_s2 = -900.0 + 8e3 * t_s,
                     .jerk_rad_s3 = 8e3};
  };
  const double h_s = 1e-4;
  const FluxTarget before = target(kWeakening, at(-h_s));
  const FluxTarget now = target(kWeakening, at(0.0));
  const FluxTarget after = target(kWeakening, at(h_s));
  EXPECT_NEAR((after.flux_wb - before.flux_wb) / (2.0 * h_s), now.rate_wb_s, 1e-6);
  EXPECT_NEAR((after.rate_wb_s - before.rate_wb_s) / (2.0 * h_s), now.second_rate_wb_s2, 1e-4);
  const double eta = kServoMotor.machine.flux_decay_per_s();
  EXPECT_NEAR(eta * (0.0117 * now.i_d_a - now.flux_wb), now.rate_wb_s, 1e-12);
}

// Catches: the feed-forward that exercise 15 goes without.
TEST(FluxReference, FeedForwardCanBeLeftToTheLoop) {
  FluxReferenceParameters p = kWeakening;
  EXPECT_NEAR(target(p, {}).i_d_a, 5.5 / std::numbers::sqrt2, 1e-12);
  p.feed_forward = 0.0;
  EXPECT_EQ(target(p, {}).i_d_a, 0.0);
  EXPECT_EQ(target(p, {}).flux_wb, kRatedFluxWb);
}

// Catches: shares that are exchanged or not under a root, and a flux that jumps with its current: it follows
// at η, over lost samples too.
TEST(FluxReference, OptimumFollowsItsCurrentAsTheMachineDoes) {
  const auto table = std::make_shared<const OptimumTorqueTable>(
      SteadyInductionModel::of(kServoMotor), VectorLimits{.voltage_v = 80.0, .current_a = 6.0},
      rad_s(8000.0));
  const FluxReferenceParameters p = {.rated_flux_wb = kRatedFluxWb,
                                     .base_speed_rad_s = 1.0,
                                     .motoring_share = 0.81,
                                     .generating_share = 0.64,
                                     .policy = FluxPolicy::kOptimumTorque};
  FluxReference flux(p, kServoMotor.machine, kPeriod_s, table);
  const double i_up_a = 0.9 * 6.0 / std::numbers::sqrt2;
  const double i_down_a = 0.8 * 6.0 / std::numbers::sqrt2;
  const FluxTarget start = flux.step({.speed_rad_s = 10.0, .acceleration_rad_s2 = 1.0});
  EXPECT_NEAR(start.i_d_a, i_up_a, 1e-9);
  EXPECT_NEAR(start.flux_wb, 0.0117 * i_up_a, 1e-9);
  const Reference braking = {.speed_rad_s = 10.0, .acceleration_rad_s2 = -1.0};
  EXPECT_NEAR(flux.step(braking).flux_wb, 0.0117 * i_up_a, 1e-9);
  const FluxTarget later = flux.step(braking, 10);
  EXPECT_NEAR(later.i_d_a, i_down_a, 1e-9);
  const double kept = std::exp(-10.0 * kPeriod_s * kServoMotor.machine.flux_decay_per_s());
  EXPECT_NEAR(later.flux_wb, 0.0117 * (i_down_a + kept * (i_up_a - i_down_a)), 1e-9);
}

}  // namespace
}  // namespace drivebench::control::flux_reference_test
