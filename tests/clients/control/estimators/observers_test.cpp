#include "clients/control/estimators/observers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "clients/control/math/wrapped.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control::observers_test {
namespace {

constexpr InductionMachineModel kServo = {.pole_pairs = 3.0,
                                          .mutual_inductance_h = 0.0117,
                                          .rotor_resistance_ohm = 3.9,
                                          .rotor_inductance_h = 0.014,
                                          .friction_nms = 1.4e-4,
                                          .inertia_kgm2 = 1.1e-4};
constexpr double kPeriodS = 125e-6;

// Catches: a swapped M, L_R or J: the derived constants of the servo machine (case 1 of the reference).
TEST(MachineModel, HasTheDerivedConstantsOfTheServoMachine) {
  EXPECT_NEAR(kServo.flux_decay_per_s(), 278.571, 278.571 * 5e-5);
  EXPECT_NEAR(kServo.acceleration_per_wb_a(), 22792.2, 22792.2 * 5e-5);
  EXPECT_NEAR(kServo.friction_rate_per_s(), 1.2727, 1e-4);
}

// Catches: a wrong sign in either transform: to_ab must undo to_dq, and d must lie along the angle.
TEST(Frames, DirectAxisLiesAlongTheAngleAndTheTransformsAreInverse) {
  const CosSin direction = cos_sin_unbounded(0.7);
  const Dq along = to_dq({.a = 2.0 * std::cos(0.7), .b = 2.0 * std::sin(0.7)}, direction);
  EXPECT_NEAR(along.d, 2.0, 1e-15);
  EXPECT_NEAR(along.q, 0.0, 1e-15);
  const TwoPhase back = to_ab(to_dq({.a = 1.5, .b = -0.25}, direction), direction);
  EXPECT_NEAR(back.a, 1.5, 1e-15);
  EXPECT_NEAR(back.b, -0.25, 1e-15);
}

// Catches: [−π, π) for (−π, π] and a wrap that only takes off one turn.
TEST(Frames, WrappedAnglesLieAboveMinusPiUpToPi) {
  constexpr double kPi = std::numbers::pi;
  EXPECT_EQ(wrapped(kPi), kPi);
  EXPECT_EQ(wrapped(-kPi), kPi);
  EXPECT_EQ(wrapped(0.5), 0.5);
  EXPECT_NEAR(wrapped(0.5 + 20.0 * kPi), 0.5, 1e-13);
  EXPECT_NEAR(wrapped(-0.5 - 20.0 * kPi), -0.5, 1e-13);
}

// Catches: a wrong η or M: with i_d held, ψ goes to M·i_d and the distance shrinks by 1 − ηT a sample,
// whatever the speed.
TEST(PolarFluxObserver, FluxApproachesItsSteadyValueAtTheRotorRate) {
  PolarFluxObserver observer(kServo, kPeriodS);
  const double final_wb = kServo.mutual_inductance_h * 3.889;
  const double factor = 1.0 - kServo.flux_decay_per_s() * kPeriodS;
  double distance_wb = final_wb - observer.magnitude_wb();
  EXPECT_EQ(observer.magnitude_wb(), 1e-4);
  for (int k = 0; k < 200; ++k) {
    observer.step({.d = 3.889, .q = 0.0}, 50.0);
    distance_wb *= factor;
    EXPECT_NEAR(final_wb - observer.magnitude_wb(), distance_wb, 1e-15);
  }
}

// Catches: n_p·ω or slip forgotten: the flux turns at n_p·ω + η·M·i_q/ψ, here over several turns.
TEST(PolarFluxObserver, FluxTurnsAtElectricalSpeedPlusSlip) {
  PolarFluxObserver observer(kServo, kPeriodS);
  for (int k = 0; k < 4000; ++k)
    observer.step({.d = 4.0, .q = 0.0}, 0.0);
  EXPECT_EQ(observer.angle_rad(), 0.0);
  const double slip_rad_s = kServo.flux_decay_per_s() * 1.5 / 4.0;  // ψ = M·i_d
  for (int k = 0; k < 800; ++k) {
    observer.step({.d = 4.0, .q = 1.5}, 70.0);
    EXPECT_GT(observer.angle_rad(), -std::numbers::pi);
    EXPECT_LE(observer.angle_rad(), std::numbers::pi);
  }
  EXPECT_NEAR(wrapped(observer.angle_rad() - 0.1 * (3.0 * 70.0 + slip_rad_s)), 0.0, 1e-9);
}

// Catches: a division by no flux: the first sample of a cold machine divides by 1e-3 Wb, not by 1e-4 Wb.
TEST(PolarFluxObserver, ColdMachineDividesByOneMilliweber) {
  PolarFluxObserver observer(kServo, kPeriodS);
  observer.step({.d = 0.0, .q = 1.0}, 0.0);
  EXPECT_NEAR(observer.angle_rad(), kPeriodS * kServo.flux_decay_per_s() * 0.0117 / 1e-3, 1e-15);
}

// Catches: exchanged gains: the book's l1 and l2 are the poles −806.5 and −994.7, and placing those gives
// them back.
TEST(SpeedObserver, BookGainsPlaceTheDerivedPoles) {
  const double friction_rate_per_s = kServo.friction_rate_per_s();
  const SpeedObserverGains placed = SpeedObserverGains::placed(806.5, 994.7, friction_rate_per_s);
  EXPECT_NEAR(placed.angle_per_s, 1.8e3, 0.2);
  EXPECT_NEAR(placed.speed_per_s2, 8e5, 100.0);
}

// Catches: a wrong sign or a mixed-up state in the observer: a free observation error obeys
// e(k+2) − (z1 + z2)·e(k+1) + z1·z2·e(k) = 0 with the Euler poles z = 1 − r·T (0.899 and 0.876 at 8 kHz).
TEST(SpeedObserver, ErrorDecaysWithTheEulerPoles) {
  const double friction_rate_per_s = kServo.friction_rate_per_s();
  SpeedObserver observer(SpeedObserverGains::placed(806.5, 994.7, friction_rate_per_s), friction_rate_per_s,
                         kPeriodS);
  const double z1 = 1.0 - 806.5 * kPeriodS;
  const double z2 = 1.0 - 994.7 * kPeriodS;
  const double angle_rad = 0.01;
  double last = angle_rad - observer.angle_rad();
  observer.step(angle_rad, 0.0);
  double now = angle_rad - observer.angle_rad();
  for (int k = 0; k < 100; ++k) {
    observer.step(angle_rad, 0.0);
    const double next = angle_rad - observer.angle_rad();
    EXPECT_NEAR(next, (z1 + z2) * now - z1 * z2 * last, 1e-15);
    last = now;
    now = next;
  }
  EXPECT_LT(std::abs(now), 1e-4 * angle_rad);
}

// Catches: a torque that is not fed forward: with the true acceleration known, a ramp of speed is followed
// without a lag beyond the Euler error of half a period.
TEST(SpeedObserver, FollowsAKnownAccelerationWithoutLag) {
  SpeedObserver observer({.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}, 0.0, kPeriodS);
  const double acceleration_rad_s2 = 3653.0;
  double t_s = 0.0;
  for (int k = 0; k < 240; ++k) {
    observer.step(0.5 * acceleration_rad_s2 * t_s * t_s, acceleration_rad_s2);
    t_s += kPeriodS;
  }
  EXPECT_NEAR(observer.speed_rad_s(), acceleration_rad_s2 * t_s, acceleration_rad_s2 * kPeriodS);
}

// Catches: a difference that ignores the periods gone by, or starts with the absolute count.
TEST(BackwardDifference, IsCountsPerElapsedTimeAndStartsAtZero) {
  BackwardDifference difference(2000, kPeriodS);
  EXPECT_EQ(difference.step(123'456, 1), 0.0);
  EXPECT_NEAR(difference.step(123'457, 1), 25.13, 0.01);
  EXPECT_NEAR(difference.step(123'455, 2), -25.13, 0.01);
}

}  // namespace
}  // namespace drivebench::control::observers_test
