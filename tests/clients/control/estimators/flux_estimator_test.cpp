#include "clients/control/estimators/flux_estimator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "plant/math/unbounded.hpp"
#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control::flux_estimator_test {
namespace {

constexpr double kPeriod_s = 125e-6;
constexpr double kR1_per_h = 200.0;
constexpr double kR2_per_h = 600.0;

FluxEstimatorParameters with_source(FluxSource source, double start_wb = 0.0) {
  return {.source = source,
          .start_wb = start_wb,
          .stator_resistance_ohm = kServoMotor.stator_resistance_ohm,
          .stator_inductance_h = kServoMotor.stator_inductance_h,
          .correction = 0.9,
          .first_rate_per_h = kR1_per_h,
          .second_rate_per_h = kR2_per_h,
          .load_pole_per_s = 300.0};
}

std::complex<double> flux_of(const FluxEstimator& x) {
  return std::polar(x.magnitude_wb(), x.angle_rad());
}

/// The difference of two estimates that start 20 mWb apart and get the same samples, after so long over the
/// difference at the start.
double left_after(FluxSource source, double time_s) {
  FluxEstimator near(kServoMotor.machine, with_source(source), kPeriod_s);
  FluxEstimator far(kServoMotor.machine, with_source(source, 0.020), kPeriod_s);
  double shaft_rad = 0.0;
  for (int k = 0; k < std::lround(time_s / kPeriod_s); ++k) {
    const TwoPhase current_a = {.a = 4.0 * std::cos(0.1 * k), .b = 4.0 * std::sin(0.1 * k)};
    const double speed_rad_s = 0.5 * k;
    for (FluxEstimator* each : {&near, &far}) {
      each->sample(current_a, shaft_rad);
      each->step({.current_a = to_dq(current_a, cos_sin_unbounded(each->angle_rad())),
                  .voltage_v = {.a = 10.0, .b = -5.0},
                  .speed_rad_s = speed_rad_s,
                  .shaft_angle_rad = shaft_rad});
    }
    shaft_rad += kPeriod_s * speed_rad_s;
  }
  for (FluxEstimator* each : {&near, &far})
    each->sample({.a = 1.0, .b = 2.0}, shaft_rad);
  return std::abs(flux_of(far) - flux_of(near)) / 0.020;
}

// Catches: an observer that is not the one that was chosen, a start that it does not take, a current that is
// not turned back into the phases: each forgets its start at its own rate, whatever speed and current.
TEST(FluxEstimator, EachSourceForgetsItsStartAtItsOwnRate) {
  const double eta_per_s = kServoMotor.machine.flux_decay_per_s();
  constexpr double kTime_s = 5e-3;
  EXPECT_NEAR(left_after(FluxSource::kExactCopy, kTime_s), std::exp(-eta_per_s * kTime_s), 1e-9);
  EXPECT_NEAR(left_after(FluxSource::kRotorFrame, kTime_s), std::exp(-eta_per_s * kTime_s), 1e-9);
  const double faster_per_s = eta_per_s / (1.0 - 0.9 * kServoMotor.stator_share());
  EXPECT_NEAR(left_after(FluxSource::kVergheseSanders, kTime_s), std::exp(-faster_per_s * kTime_s), 1e-9);
  // With a current error of 0 at the start: (r2·e^(−R·r1·t) − r1·e^(−R·r2·t))/(r2 − r1), turned by the
  // rotor's L_R·r of each part; at so low an angle the size is that of the sum to a tenth.
  const double slow = std::exp(-3.9 * kR1_per_h * kTime_s);
  const double fast = std::exp(-3.9 * kR2_per_h * kTime_s);
  const double both = (kR2_per_h * slow - kR1_per_h * fast) / (kR2_per_h - kR1_per_h);
  EXPECT_NEAR(left_after(FluxSource::kMartinRouchon, kTime_s), both, 0.1 * both);
}

// Catches: a start that the Euler copy takes but does not forget by its factor.
TEST(FluxEstimator, TheEulerCopyMultipliesByItsFactor) {
  double square = 1.0;
  for (int k = 0; k < 40; ++k)
    square *= euler_error_factor(kServoMotor.machine, 0.5 * k, kPeriod_s);
  EXPECT_NEAR(left_after(FluxSource::kEulerCopy, 40 * kPeriod_s), std::sqrt(square), 1e-9);
}

// Catches: a polar observer that changed by being a choice: the same bits as on its own, over a gap too.
TEST(FluxEstimator, ThePolarChoiceIsThePolarObserver) {
  FluxEstimator chosen(kServoMotor.machine, with_source(FluxSource::kPolar), kPeriod_s);
  PolarFluxObserver alone(kServoMotor.machine, kPeriod_s);
  for (int k = 0; k < 200; ++k) {
    const Dq current_a = {.d = 4.0, .q = 0.02 * k - 2.0};
    chosen.step({.current_a = current_a,
                 .voltage_v = {.a = 1.0, .b = 1.0},
                 .speed_rad_s = 0.3 * k,
                 .shaft_angle_rad = 0.1});
    alone.step(current_a, 0.3 * k);
    if (k % 3 == 0) chosen.sample({.a = 7.0, .b = 7.0}, 0.2);
    ASSERT_EQ(chosen.magnitude_wb(), alone.magnitude_wb());
    ASSERT_EQ(chosen.angle_rad(), alone.angle_rad());
  }
  EXPECT_FALSE(chosen.motion());
}

// Catches: a number that an observer cannot bear, or lacks, and no sentence about it.
TEST(FluxEstimator, NumbersThatTheObserverCannotBearAreNamed) {
  const auto problem = [](FluxSource source, double FluxEstimatorParameters::*number, double value) {
    FluxEstimatorParameters p = with_source(source);
    p.*number = value;
    const std::vector<std::string> found = p.problems("flux_observer.", kServoMotor.machine, kPeriod_s);
    return found.empty() ? std::string("none") : found.front();
  };
  using P = FluxEstimatorParameters;
  const auto vs = FluxSource::kVergheseSanders;
  const auto mr = FluxSource::kMartinRouchon;
  EXPECT_EQ(problem(vs, &P::correction, 1.19), "none");  // L_R/M is 1.197
  EXPECT_EQ(problem(vs, &P::correction, 1.2).rfind("flux_observer.correction must be below L_R/M", 0), 0U);
  EXPECT_EQ(problem(vs, &P::stator_resistance_ohm, 0.0).rfind("flux_observer.stator_resistance_ohm", 0), 0U);
  EXPECT_EQ(problem(mr, &P::stator_inductance_h, 0.009).rfind("flux_observer.stator_inductance_h", 0), 0U);
  EXPECT_EQ(problem(mr, &P::first_rate_per_h, kR2_per_h).rfind("flux_observer.first_rate_per_h", 0), 0U);
  EXPECT_EQ(problem(FluxSource::kRotorFrame, &P::load_pole_per_s, 16001.0)
                .rfind("flux_observer.load_pole_per_s must be positive and below twice", 0),
            0U);
  EXPECT_EQ(problem(FluxSource::kPolar, &P::stator_inductance_h, 0.0), "none");
}

}  // namespace
}  // namespace drivebench::control::flux_estimator_test
