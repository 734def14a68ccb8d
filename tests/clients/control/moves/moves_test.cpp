// Trajectories beside the cubic one, and what they need of DC-A.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "clients/control/dc/dc_references.hpp"
#include "clients/control/moves/speed_ramp.hpp"
#include "clients/control/moves/standard_inputs.hpp"

namespace drivebench::control::moves_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr TrajectoryParameters kTimes = {
    .distance_rad = kPi, .ramp_up_s = 0.025, .cruise_s = 0.015, .ramp_down_s = 0.040};

/// Every member must be the derivative of the one before: central differences at points away from corners.
void expect_derivatives(const Trajectory& move, double from_s, double to_s, bool with_jerk) {
  constexpr double kStep_s = 1e-6;
  for (int k = 1; k < 40; ++k) {
    const double t = from_s + (to_s - from_s) * k / 40.0;
    const Reference before = move.at(t - kStep_s);
    const Reference at = move.at(t);
    const Reference after = move.at(t + kStep_s);
    const auto slope = [](double a, double b) { return (b - a) / (2.0 * kStep_s); };
    EXPECT_NEAR(at.speed_rad_s, slope(before.angle_rad, after.angle_rad), 1e-4) << t;
    EXPECT_NEAR(at.acceleration_rad_s2, slope(before.speed_rad_s, after.speed_rad_s), 1e-2) << t;
    if (with_jerk) {
      EXPECT_NEAR(at.jerk_rad_s3, slope(before.acceleration_rad_s2, after.acceleration_rad_s2), 5.0) << t;
    }
  }
}

// Catches: a wrong coefficient in any of the curves, up or down.
TEST(Moves, EverySpeedIsTheSlopeOfItsAngleAndSoOn) {
  const JerkContinuousMove smooth(kTimes);
  const TrapezoidalMove straight(kTimes);
  const double corners_s[] = {0.0, 0.025, 0.040, 0.080};
  for (std::size_t k = 0; k < 3; ++k) {
    expect_derivatives(smooth, corners_s[k], corners_s[k + 1], true);
    expect_derivatives(straight, corners_s[k], corners_s[k + 1], false);
  }
  const SpeedRamp ramp({.speed_rad_s = -120.0, .ramp_s = 0.2, .cruise_s = 0.1});
  expect_derivatives(ramp, 0.0, 0.2, true);
  expect_derivatives(ramp, 0.2, 0.3, true);
  const SineTorqueMove sine({.amplitude_rad_s2 = 1166.7,
                             .angular_frequency_rad_s = 96.66,
                             .friction_rate_per_s = 6.67,
                             .duration_s = 0.2});
  expect_derivatives(sine, 0.0, 0.2, true);
  const SineTorqueMove frictionless({.amplitude_rad_s2 = 1166.7,
                                     .angular_frequency_rad_s = 96.66,
                                     .friction_rate_per_s = 0.0,
                                     .duration_s = 0.2});
  expect_derivatives(frictionless, 0.0, 0.2, true);
  expect_derivatives(SineMove({.amplitude_rad = 2.0, .angular_frequency_rad_s = 30.0, .duration_s = 0.2}),
                     0.0, 0.2, true);
}

// Catches: a ramp that does not end where the next part begins, and a move that is not at rest outside.
TEST(Moves, ArriveAtTheirDistanceWithUnequalRamps) {
  std::vector<std::unique_ptr<Trajectory>> moves;
  moves.push_back(std::make_unique<JerkContinuousMove>(kTimes));
  moves.push_back(std::make_unique<TrapezoidalMove>(kTimes));
  for (const auto& move : moves) {
    EXPECT_NEAR(move->duration_s(), 0.080, 1e-15);
    EXPECT_EQ(move->at(-1e-3).angle_rad, 0.0);
    EXPECT_EQ(move->at(-1e-3).acceleration_rad_s2, 0.0);
    EXPECT_NEAR(move->at(0.080).angle_rad, kPi, 1e-15);
    EXPECT_EQ(move->at(1.0).angle_rad, kPi);
    EXPECT_EQ(move->at(1.0).speed_rad_s, 0.0);
    for (const double corner_s : {0.025, 0.040}) {
      EXPECT_NEAR(move->at(corner_s - 1e-9).angle_rad, move->at(corner_s + 1e-9).angle_rad, 1e-6);
      EXPECT_NEAR(move->at(corner_s - 1e-9).speed_rad_s, move->at(corner_s + 1e-9).speed_rad_s, 1e-4);
    }
  }
}

// TRJ-02. Catches: a curve that is merely smooth: α peaks at 1.875·ω_m/t1 halfway, j at 5.7735·ω_m/t1² at x =
// 0.2113, and the jerk is 0 at all corners.
TEST(JerkContinuousMove, HasThePeaksOfItsPolynomial) {
  const JerkContinuousMove move(kTimes);
  const double top_rad_s = kTimes.max_speed_rad_s();
  EXPECT_NEAR(move.at(0.0125).acceleration_rad_s2, 1.875 * top_rad_s / 0.025, 1e-9);
  double peak = 0.0;
  for (int k = 0; k <= 25000; ++k)
    peak = std::max(peak, move.at(1e-6 * k).jerk_rad_s3);
  EXPECT_NEAR(peak, 5.7735 * top_rad_s / (0.025 * 0.025), 1e-4 * peak);
  EXPECT_NEAR(move.at(0.2113249 * 0.025).jerk_rad_s3, peak, 1e-6 * peak);
  for (const double corner_s : {0.0, 0.025, 0.040, 0.080}) {
    EXPECT_NEAR(move.at(corner_s - 1e-9).jerk_rad_s3, 0.0, 10.0);
    EXPECT_NEAR(move.at(corner_s + 1e-9).jerk_rad_s3, 0.0, 10.0);
  }
}

// Catches: a speed that falls back to rest at the end of the ramp, an angle that goes on for ever.
TEST(SpeedRamp, KeepsItsSpeed) {
  const SpeedRamp ramp({.speed_rad_s = 120.0, .ramp_s = 0.2, .cruise_s = 0.1});
  EXPECT_NEAR(ramp.at(0.1).speed_rad_s, 60.0, 1e-12);
  EXPECT_NEAR(ramp.at(0.3).angle_rad, 120.0 * 0.2, 1e-12);
  EXPECT_EQ(ramp.at(5.0).speed_rad_s, 120.0);
  EXPECT_NEAR(ramp.at(5.0).angle_rad, 24.0, 1e-12);
}

// AC-09. Catches: v_ref without its inductive part, i_ref without friction: the table of TRJ-01 for DC-A and
// half a turn, 0.1 % (the table's digits where they are fewer).
TEST(CubicMove, NeedsTheBooksCurrentsAndVoltagesOfDcA) {
  constexpr DcMachineModel kDcA = {.resistance_ohm = 2.0,
                                   .inductance_h = 2e-3,
                                   .torque_constant_nm_per_a = 0.07,
                                   .inertia_kgm2 = 6e-5,
                                   .friction_nms = 4e-4};
  struct Case {
    double t1_s, t2_s, top_rad_s, peak_rad_s2, i_max_a, i_min_a, v_max_v, v_min_v;
  };
  for (const Case& c : {Case{0.020, 0.045, 69.813, 5236.0, 4.692, -4.294, 12.04, -6.36},
                        Case{0.025, 0.040, 78.540, 4712.4, 4.271, -3.822, 11.69, -5.30},
                        Case{0.0325, 0.0325, 96.664, 4461.4, 4.112, -3.559, 12.38, -4.51},
                        Case{0.030, 0.038, 82.673, 4133.7, 3.788, -3.316, 11.06, -4.32}}) {
    const CubicMove move(
        {.distance_rad = kPi, .ramp_up_s = c.t1_s, .cruise_s = c.t2_s - c.t1_s, .ramp_down_s = c.t1_s});
    EXPECT_NEAR(move.duration_s(), c.t1_s + c.t2_s, 1e-12);
    double top = 0.0, peak = 0.0, i_max = 0.0, i_min = 0.0, v_max = 0.0, v_min = 0.0;
    for (double t = 0.0; t < move.duration_s(); t += 1e-6) {
      const Reference r = move.at(t);
      top = std::max(top, r.speed_rad_s);
      peak = std::max(peak, r.acceleration_rad_s2);
      i_max = std::max(i_max, reference_current_a(kDcA, r));
      i_min = std::min(i_min, reference_current_a(kDcA, r));
      v_max = std::max(v_max, reference_voltage_v(kDcA, r));
      v_min = std::min(v_min, reference_voltage_v(kDcA, r));
    }
    EXPECT_NEAR(top, c.top_rad_s, 1e-3 * c.top_rad_s);
    EXPECT_NEAR(peak, c.peak_rad_s2, 1e-3 * c.peak_rad_s2);
    EXPECT_NEAR(i_max, c.i_max_a, 1e-3 * c.i_max_a);
    EXPECT_NEAR(i_min, c.i_min_a, 1e-3 * -c.i_min_a);
    EXPECT_NEAR(v_max, c.v_max_v, 1e-3 * c.v_max_v);
    EXPECT_NEAR(v_min, c.v_min_v, 1e-3 * -c.v_min_v + 0.004);
  }
}

// Catches: a sine that a controller does not get back: the current of the reference must be 1 A·sin(Ωt), and
// a shaft without friction is no special case.
TEST(SineTorqueMove, GivesTheCurrentOfASine) {
  constexpr double kRate = 4e-4 / 6e-5;
  constexpr double kPerAmpere = 0.07 / 6e-5;
  for (const double rate : {kRate, 0.0}) {
    const SineTorqueMove move({.amplitude_rad_s2 = kPerAmpere,
                               .angular_frequency_rad_s = 96.66,
                               .friction_rate_per_s = rate,
                               .duration_s = 1.0});
    for (int k = 0; k < 100; ++k) {
      const Reference r = move.at(0.01 * k);
      EXPECT_NEAR((r.acceleration_rad_s2 + rate * r.speed_rad_s) / kPerAmpere, std::sin(96.66 * 0.01 * k),
                  1e-12);
    }
    EXPECT_EQ(move.at(0.0).angle_rad, 0.0);
    EXPECT_EQ(move.at(0.0).speed_rad_s, 0.0);
  }
}

}  // namespace
}  // namespace drivebench::control::moves_test
