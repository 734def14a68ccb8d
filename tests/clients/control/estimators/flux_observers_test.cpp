#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "clients/control/estimators/flux_observers.hpp"
#include "clients/control/estimators/observers.hpp"
#include "clients/control/math/wrapped.hpp"
#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control::flux_observers_test {
namespace {

using Complex = std::complex<double>;

constexpr double kLine_rad_s = 377.0;

Complex complex_of(TwoPhase x) {
  return {x.a, x.b};
}

/// Currents and voltages that have nothing to do with each other: differences of two observers must not see
/// them.
TwoPhase wave(int k, double amplitude, double phase_rad) {
  return {.a = amplitude * std::cos(0.3 * k + phase_rad), .b = amplitude * std::sin(0.17 * k)};
}

/// The factor by which one step multiplies the squared difference of two stationary observers.
double factor_of_one_step(FluxStep kind, double rate_hz) {
  StationaryFluxObserver a(kServoMotor.machine, 1.0 / rate_hz, kind);
  StationaryFluxObserver b(kServoMotor.machine, 1.0 / rate_hz, kind);
  b.start_at({.a = 0.03, .b = -0.01});
  const double before = std::norm(complex_of(b.flux_wb()) - complex_of(a.flux_wb()));
  a.step({.a = 3.0, .b = 1.0}, kLine_rad_s);
  b.step({.a = 3.0, .b = 1.0}, kLine_rad_s);
  return std::norm(complex_of(b.flux_wb()) - complex_of(a.flux_wb())) / before;
}

// Case 16: 0.1 %. Catches: a decay or a rotation of the wrong size, and an Euler that is exact.
TEST(StationaryFluxObserver, EulerMultipliesTheErrorByTheDerivedFactor) {
  EXPECT_NEAR(factor_of_one_step(FluxStep::kEuler, 330.0), 11.77, 0.0118);
  EXPECT_NEAR(factor_of_one_step(FluxStep::kEuler, 1000.0), 1.800, 0.0018);
  EXPECT_NEAR(factor_of_one_step(FluxStep::kEuler, 2000.0), 1.061, 0.0011);
  EXPECT_NEAR(factor_of_one_step(FluxStep::kEuler, 10e3), 0.958, 0.00096);
  for (const double rate_hz : {330.0, 1e3, 10e3}) {
    EXPECT_NEAR(factor_of_one_step(FluxStep::kEuler, rate_hz),
                euler_error_factor(kServoMotor.machine, kLine_rad_s, 1.0 / rate_hz), 1e-9);
  }
}

// Case 16: 1 Hz. Catches: a limit without its half: at this rate the factor is one.
TEST(StationaryFluxObserver, EulerNeedsARateThatRisesWithTheSpeed) {
  const double least_hz = least_euler_rate_hz(kServoMotor.machine, kLine_rad_s);
  EXPECT_NEAR(least_hz, 2435.0, 1.0);
  EXPECT_NEAR(euler_error_factor(kServoMotor.machine, kLine_rad_s, 1.0 / least_hz), 1.0, 1e-12);
  EXPECT_NEAR(least_euler_rate_hz(kServoMotor.machine, rad_s(8000.0)), 11477.0, 1.0);
}

// Catches: an exponential of the real part only: exp(-2ηT) at every rate, 330 Hz included.
TEST(StationaryFluxObserver, ExactStepsDecayAtTheRotorRateAtAnyRate) {
  const double eta = kServoMotor.machine.flux_decay_per_s();
  for (const double rate_hz : {330.0, 1e3, 10e3})
    EXPECT_NEAR(factor_of_one_step(FluxStep::kExact, rate_hz), std::exp(-2.0 * eta / rate_hz), 1e-12);
}

// Catches: an input that is not divided by the rate: with a current that turns as fast as the rotor the flux
// stands at M·i in the rotor's frame, here at standstill.
TEST(StationaryFluxObserver, BothDiscretisationsComeToRestAtMTimesI) {
  for (const FluxStep kind : {FluxStep::kEuler, FluxStep::kExact}) {
    StationaryFluxObserver observer(kServoMotor.machine, 125e-6, kind);
    for (int k = 0; k < 1000; ++k)
      observer.step({.a = 4.0, .b = -1.0}, 0.0);
    EXPECT_NEAR(observer.flux_wb().a, 0.0117 * 4.0, 1e-12);
    EXPECT_NEAR(observer.flux_wb().b, -0.0117, 1e-12);
  }
}

// Catches: a slip of the wrong sign and an angle without the pole pairs: the same as the polar observer that
// is told the speed.
TEST(PositionFluxObserver, AgreesWithThePolarObserverWithoutTheSpeed) {
  PositionFluxObserver position(kServoMotor.machine, 125e-6);
  PolarFluxObserver polar(kServoMotor.machine, 125e-6);
  double shaft_rad = 0.0;
  for (int k = 0; k < 2000; ++k) {
    const double speed_rad_s = 0.1 * k;
    EXPECT_NEAR(wrapped(position.angle_rad(shaft_rad) - polar.angle_rad()), 0.0, 1e-9);
    EXPECT_EQ(position.magnitude_wb(), polar.magnitude_wb());
    const Dq current_a = {.d = 4.0, .q = -2.0 + 0.002 * k};
    position.step(current_a);
    polar.step(current_a, speed_rad_s);
    shaft_rad += 125e-6 * speed_rad_s;
  }
  EXPECT_GT(shaft_rad, 20.0);
}

/// Rate at which the difference of two observers decays [1/s], while the speed changes.
double verghese_sanders_rate_per_s(const InductionMotorModel& motor, double gain) {
  constexpr double kPeriod_s = 1e-4;
  constexpr int kSteps = 200;
  VergheseSandersObserver a(motor, gain, kPeriod_s);
  VergheseSandersObserver b(motor, gain, kPeriod_s);
  b.start_at({.a = 1e-3, .b = 1e-3}, {.a = 0.0, .b = 0.0});
  a.start_at({.a = 0.0, .b = 0.0}, {.a = 0.0, .b = 0.0});
  for (int k = 0; k < kSteps; ++k) {
    for (VergheseSandersObserver* observer : {&a, &b})
      observer->step(wave(k, 5.0, 1.0), wave(k, 60.0, 0.2), 0.5 * k);
  }
  const TwoPhase current_a = wave(kSteps, 5.0, 1.0);
  const double left = std::abs(complex_of(b.flux_wb(current_a)) - complex_of(a.flux_wb(current_a))) /
                      std::abs(Complex(1e-3, 1e-3));
  return -std::log(left) / (kSteps * kPeriod_s);
}

// Case 18: 1 %. Catches: a gain of the wrong sign and a correction without its leakage part. M is assumed.
TEST(VergheseSandersObserver, ErrorRatesOfTheTextsExample) {
  const InductionMotorModel motor = {.machine = {.pole_pairs = 2.0,
                                                 .mutual_inductance_h = 0.0806,
                                                 .rotor_resistance_ohm = 0.8,
                                                 .rotor_inductance_h = 0.085,
                                                 .friction_nms = 0.0,
                                                 .inertia_kgm2 = 0.06},
                                     .stator_resistance_ohm = 0.6,
                                     .stator_inductance_h = 0.085};
  EXPECT_NEAR(verghese_sanders_rate_per_s(motor, 0.0), 9.41, 0.0941);
  EXPECT_NEAR(verghese_sanders_rate_per_s(motor, 0.9), 64.2, 0.642);
  EXPECT_NEAR(verghese_sanders_rate_per_s(motor, 1.0), 181.8, 1.818);
  EXPECT_NEAR(verghese_sanders_rate_per_s(motor, 1.2), -68.3, 0.683);
  EXPECT_NEAR(VergheseSandersObserver(motor, 0.9, 1e-4).error_decay_per_s(), 64.2, 0.642);
}

// Catches: gains that do not belong to the rates, and an error that does not turn back with the rotor: along
// the eigenvector (c1, r1) the error is exp(-(R_R·t - j·n_p·θ·L_R)·r1) of itself, however the speed changes.
TEST(MartinRouchonObserver, ErrorFollowsItsClosedForm) {
  constexpr double kR1_per_h = 60.0;
  constexpr double kR2_per_h = 150.0;
  constexpr double kPeriod_s = 125e-6;
  MartinRouchonObserver a(kServoMotor, kR1_per_h, kR2_per_h, kPeriod_s);
  MartinRouchonObserver b(kServoMotor, kR1_per_h, kR2_per_h, kPeriod_s);
  const double scale = 1e-3;
  a.start_at({.a = 0.0, .b = 0.0}, {.a = 0.0, .b = 0.0});
  b.start_at({.a = scale * a.flux_gain(), .b = 0.0}, {.a = scale * kR1_per_h, .b = 0.0});
  double shaft_rad = 0.0;
  for (int k = 0; k < 80; ++k) {
    const double speed_rad_s = 200.0 - 5.0 * k;
    for (MartinRouchonObserver* observer : {&a, &b})
      observer->step(wave(k, 5.0, 1.0), wave(k, 60.0, 0.2), speed_rad_s);
    shaft_rad += kPeriod_s * speed_rad_s;
    const Complex expected =
        scale * std::exp(-kR1_per_h * Complex(3.9 * kPeriod_s * (k + 1), -3.0 * shaft_rad * 0.014));
    const Complex flux_error = complex_of(b.stator_flux_wb()) - complex_of(a.stator_flux_wb());
    const Complex current_error = complex_of(b.current_a()) - complex_of(a.current_a());
    EXPECT_NEAR(std::abs(flux_error - a.flux_gain() * expected), 0.0, 1e-9 * scale) << k;
    EXPECT_NEAR(std::abs(current_error - kR1_per_h * expected), 0.0, 1e-9) << k;
  }
}

}  // namespace
}  // namespace drivebench::control::flux_observers_test
