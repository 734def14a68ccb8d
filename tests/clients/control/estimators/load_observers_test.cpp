#include "clients/control/estimators/load_observers.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "clients/control/estimators/flux_observers.hpp"
#include "clients/control/math/polynomial.hpp"
#include "clients/control/math/wrapped.hpp"
#include "plant/math/unbounded.hpp"
#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control::load_observers_test {
namespace {

constexpr double kPeriod_s = 125e-6;
constexpr InductionMachineModel kServo = kServoMotor.machine;
constexpr double kFriction_per_s = kServo.friction_rate_per_s();

// Catches: the printed l2, which has r1·r2 twice and no r1·r3: the characteristic polynomial must have the
// wanted roots.
TEST(LoadTorqueObserver, GainsPlaceThreePoles) {
  const LoadObserverGains g = LoadObserverGains::placed(300.0, 500.0, 800.0, kFriction_per_s);
  EXPECT_LT(g.load_per_s3, 0.0);
  const std::array<double, 4> characteristic = {
      -g.load_per_s3, g.speed_per_s2 + g.angle_per_s * kFriction_per_s, g.angle_per_s + kFriction_per_s, 1.0};
  const std::vector<double> poles = real_roots(characteristic);
  ASSERT_EQ(poles.size(), 3U);
  EXPECT_NEAR(poles[0], -800.0, 1e-6);
  EXPECT_NEAR(poles[1], -500.0, 1e-6);
  EXPECT_NEAR(poles[2], -300.0, 1e-6);
}

// Catches: a load with the wrong sign, and one that the speed does not feel (as the slides print it, which
// cannot converge): the error of a free observer obeys the Euler recursion with z = 1 - r·T.
TEST(LoadTorqueObserver, ErrorObeysItsCharacteristicPolynomial) {
  LoadTorqueObserver observer(kServo, LoadObserverGains::placed(300.0, 500.0, 800.0, kFriction_per_s),
                              kPeriod_s);
  const double z1 = 1.0 - 300.0 * kPeriod_s;
  const double z2 = 1.0 - 500.0 * kPeriod_s;
  const double z3 = 1.0 - 800.0 * kPeriod_s;
  std::array<double, 4> e{};
  for (int k = 0; k < 200; ++k) {
    e = {e[1], e[2], e[3], 0.01 - observer.angle_rad()};
    observer.step(0.01, 0.0);
    if (k < 3) continue;
    EXPECT_NEAR(e[3], (z1 + z2 + z3) * e[2] - (z1 * z2 + z1 * z3 + z2 * z3) * e[1] + z1 * z2 * z3 * e[0],
                1e-15);
  }
}

// Catches: a scale without the inertia: a machine that accelerates less than its torque would have it shows
// the difference as load, 0.1 N·m, to the Euler error of half a period.
TEST(LoadTorqueObserver, FindsTheLoad) {
  LoadTorqueObserver observer(kServo, LoadObserverGains::placed(300.0, 500.0, 800.0, kFriction_per_s),
                              kPeriod_s);
  const double motor_rad_s2 = 3000.0;
  const double load_rad_s2 = 0.1 / kServo.inertia_kgm2;
  double angle_rad = 0.0;
  double speed_rad_s = 0.0;
  for (int k = 0; k < 800; ++k) {
    observer.step(angle_rad, motor_rad_s2);
    angle_rad += kPeriod_s * speed_rad_s;
    speed_rad_s += kPeriod_s * (motor_rad_s2 - load_rad_s2 - kFriction_per_s * speed_rad_s);
  }
  EXPECT_NEAR(observer.load_nm(), 0.1, 1e-4);
  EXPECT_NEAR(observer.speed_rad_s(), speed_rad_s, 1e-6 * speed_rad_s);
}

// Catches: a decay that depends on the speed: two observers of the flux come together as exp(-ηt) while the
// shaft turns by any angle.
TEST(RotorFrameObserver, FluxErrorDecaysAtTheRotorRateWhateverTheShaftDoes) {
  const LoadObserverGains gains = LoadObserverGains::placed(300.0, 500.0, 800.0, kFriction_per_s);
  RotorFrameObserver a(kServo, gains, kPeriod_s);
  RotorFrameObserver b(kServo, gains, kPeriod_s);
  b.start_at({.a = 0.02, .b = 0.01});
  for (int k = 0; k < 100; ++k) {
    const double shaft_rad = 1e-3 * k * k;
    for (RotorFrameObserver* observer : {&a, &b})
      observer->step({.a = 3.0, .b = -1.0}, shaft_rad);
  }
  const double left = std::exp(-kServo.flux_decay_per_s() * 100.0 * kPeriod_s);
  EXPECT_NEAR(b.rotor_frame_flux_wb().a - a.rotor_frame_flux_wb().a, 0.02 * left, 1e-12);
  EXPECT_NEAR(b.rotor_frame_flux_wb().b - a.rotor_frame_flux_wb().b, 0.01 * left, 1e-12);
}

// Catches: a transform the wrong way round: currents that stand still in the rotor's frame build up M·i
// there, and the flux in the stator's frame lies along the current.
TEST(RotorFrameObserver, FluxLiesAlongACurrentThatTurnsWithTheRotor) {
  RotorFrameObserver observer(kServo, LoadObserverGains::placed(300.0, 500.0, 800.0, kFriction_per_s),
                              kPeriod_s);
  double shaft_rad = 0.0;
  for (int k = 0; k < 800; ++k) {
    shaft_rad = 0.01 * k;
    observer.step({.a = 4.0 * std::cos(3.0 * shaft_rad), .b = 4.0 * std::sin(3.0 * shaft_rad)}, shaft_rad);
  }
  EXPECT_NEAR(observer.flux_wb(shaft_rad).a, 0.0468 * std::cos(3.0 * shaft_rad), 1e-10);
  EXPECT_NEAR(observer.flux_wb(shaft_rad).b, 0.0468 * std::sin(3.0 * shaft_rad), 1e-10);
}

// Catches: a torque or slip from the wrong axis, and an observer that turns its flux with the true speed
// only: a machine in the same Euler steps, already turning at 20 rad/s when the observer starts at rest, must
// be found in all four states. The flux error is left, which has decayed by exp(-0.2·η).
TEST(CoupledObserver, FindsAllFourStates) {
  CoupledObserver observer(kServo, {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}, kPeriod_s);
  PolarFluxObserver machine(kServo, kPeriod_s);
  const Dq current_a = {.d = 4.0, .q = 1.5};
  double shaft_rad = 0.0;
  double speed_rad_s = 20.0;
  for (int k = 0; k < 1600; ++k) {
    observer.step(to_ab(current_a, cos_sin_unbounded(machine.angle_rad())), shaft_rad);
    const double motor_rad_s2 = kServo.acceleration_per_wb_a() * machine.magnitude_wb() * current_a.q;
    machine.step(current_a, speed_rad_s);
    shaft_rad += kPeriod_s * speed_rad_s;
    speed_rad_s += kPeriod_s * (motor_rad_s2 - kFriction_per_s * speed_rad_s);
  }
  EXPECT_GT(speed_rad_s, 100.0);
  EXPECT_NEAR(observer.speed_rad_s(), speed_rad_s, 1e-6);
  EXPECT_NEAR(observer.angle_rad(), shaft_rad, 1e-6);
  EXPECT_NEAR(observer.flux_magnitude_wb(), machine.magnitude_wb(), 1e-9);
  EXPECT_NEAR(wrapped(observer.flux_angle_rad() - machine.angle_rad()), 0.0, 1e-6);
}

}  // namespace
}  // namespace drivebench::control::load_observers_test
