// The laws for DC motors against closed forms: DC-A under an ideal current, an encoder so fine that the
// backward difference is the speed half a sample ago, 20 kHz.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "clients/control/dc/dc_current_regulator.hpp"
#include "clients/control/dc/dc_nested_loops.hpp"
#include "clients/control/dc/dc_open_loop.hpp"
#include "clients/control/dc/dc_sine_loop.hpp"
#include "clients/control/dc/dc_speed_loop.hpp"
#include "clients/control/dc/dc_state_feedback.hpp"
#include "clients/control/dc/dc_tachometer_loop.hpp"
#include "clients/control/dc/dc_voltage_feedback.hpp"
#include "clients/control/moves/standard_inputs.hpp"
#include "tests/clients/control/dc/ideal_dc_shaft.hpp"

namespace drivebench::control::dc_controllers_test {
namespace {

constexpr DcMachineModel kDcA = {.resistance_ohm = 2.0,
                                 .inductance_h = 2e-3,
                                 .torque_constant_nm_per_a = 0.07,
                                 .inertia_kgm2 = 6e-5,
                                 .friction_nms = 4e-4};
constexpr double kFriction = kDcA.friction_rate_per_s();
constexpr double kLoad_nm = 0.035;

/// No limits: the closed forms have none.
constexpr DcAxisParameters kAxis = {
    .machine = kDcA,
    .sample_rate_hz = 20000.0,
    .current_limit_a = 1e6,
    .voltage_limit_v = 1e6,
    .shaft = {.counts_per_revolution = kFineCounts, .source = ShaftSpeed::kBackwardDifference}};

constexpr DcAxisParameters observed(double p_per_s) {
  DcAxisParameters axis = kAxis;
  axis.shaft.source = ShaftSpeed::kObserver;
  axis.shaft.observer = ShaftObserverGains::placed(std::array{p_per_s, p_per_s}, kFriction);
  return axis;
}

/// Runs a controller on the shaft and shows time, error and current to the visitor at every sample.
template <class Visitor>
void run(Controller& controller, const Trajectory& move, double duration_s, double load_nm, Visitor visit) {
  IdealDcShaft shaft;
  const double period_s = kAxis.period_s();
  double current_a = 0.0;
  for (int k = 0; k * period_s < duration_s; ++k) {
    const double t = k * period_s;
    const Reference r = move.at(t);
    const double error_rad = r.angle_rad - shaft.angle_rad;
    current_a = controller.update({.encoder_count = shaft.count(kFineCounts), .i_a_a = current_a}, r, 1).a;
    visit(t, error_rad, current_a, shaft.speed_rad_s);
    shaft.step(current_a, load_nm, period_s);
  }
}

const StepMove kRest({.distance_rad = 0.0, .speed_rad_s = 0.0, .duration_s = 1.0});

constexpr ServoGains kTriple = ServoGains::placed(placed_polynomial<3>({100.0, 100.0, 100.0}), kFriction);

// Catches: a gain with f/J of the wrong sign or in other units: the book's numbers for r = 100.
TEST(DcStateFeedback, HasTheBooksGains) {
  EXPECT_DOUBLE_EQ(kTriple.integral_per_s3, 1e6);
  EXPECT_DOUBLE_EQ(kTriple.proportional_per_s2, 3e4);
  EXPECT_NEAR(kTriple.derivative_per_s, 293.3333, 1e-4);
  EXPECT_NEAR(kTriple.derivative_per_s / kDcA.acceleration_per_a(), 0.251429, 1e-6);
  constexpr ServoGains kDouble = ServoGains::placed(placed_polynomial<2>({100.0, 100.0}), kFriction);
  EXPECT_NEAR(kDouble.derivative_per_s, 193.3333, 1e-4);
  EXPECT_EQ(kDouble.integral_per_s3, 0.0);
}

// AC-10. Catches: a pole away from its place, an integral that is too slow: e = (τ_L/J)·t²/2·e^(−rt), peak
// 0.015789 rad at 20 ms, then nothing, with half an ampere of feedback. 1 %: the speed is half a sample old.
TEST(DcStateFeedback, AConstantLoadLeavesNoError) {
  DcStateFeedback controller({.axis = kAxis, .position = kTriple});
  double peak_rad = 0.0;
  double peak_s = 0.0;
  double last_rad = 0.0;
  double last_a = 0.0;
  run(controller, kRest, 0.3, kLoad_nm, [&](double t, double error_rad, double current_a, double) {
    if (error_rad > peak_rad) {
      peak_rad = error_rad;
      peak_s = t;
    }
    last_rad = error_rad;
    last_a = current_a;
  });
  EXPECT_NEAR(peak_rad, 0.015789, 0.00016);
  EXPECT_NEAR(peak_s, 0.020, 0.0005);
  EXPECT_NEAR(last_rad, 0.0, 1e-6);
  EXPECT_NEAR(last_a, 0.5, 1e-4);
}

// AC-10, with the speed of an observer that knows nothing of the load: twice the peak, 0.034 rad. 10 %.
// Catches: an observer without the bias it must have.
TEST(DcStateFeedback, TheObserversBiasDoublesThePeak) {
  DcStateFeedback controller({.axis = observed(500.0), .position = kTriple});
  double peak_rad = 0.0;
  double last_rad = 0.0;
  run(controller, kRest, 0.5, kLoad_nm, [&](double, double error_rad, double, double) {
    peak_rad = std::max(peak_rad, error_rad);
    last_rad = error_rad;
  });
  EXPECT_NEAR(peak_rad, 0.034, 0.0034);
  EXPECT_NEAR(last_rad, 0.0, 1e-5);
}

// AC-11. Catches: an offset measured the wrong way: e = −θ0·e^(−x)·(1 + x − x²), overshoot 0.02489 rad at 30
// ms, first current −2.571 A. 2 %.
TEST(DcStateFeedback, AnInitialOffsetOvershootsAsATriplePole) {
  DcStateFeedback controller({.axis = kAxis, .position = kTriple});
  const StepMove offset({.distance_rad = -0.1, .speed_rad_s = 0.0, .duration_s = 1.0});
  double first_a = 0.0;
  double overshoot_rad = 0.0;
  double overshoot_s = 0.0;
  run(controller, offset, 0.3, 0.0, [&](double t, double error_rad, double current_a, double) {
    if (t == 0.0) first_a = current_a;
    if (error_rad > overshoot_rad) {
      overshoot_rad = error_rad;
      overshoot_s = t;
    }
    const double x = 100.0 * t;
    EXPECT_NEAR(error_rad, -0.1 * std::exp(-x) * (1.0 + x - x * x), 1e-3);
  });
  EXPECT_NEAR(first_a, -2.5714, 1e-4);
  EXPECT_NEAR(overshoot_rad, 0.024894, 0.0005);
  EXPECT_NEAR(overshoot_s, 0.030, 0.001);
}

// AC-12. Catches: an integral that is there all the same, a speed gain with the wrong sign: without it
// τ_L/(J·K1) = 0.058333 rad stay, with the observer (τ_L/J)·(1 + K2·l1/p²)/K1 = 0.10314 rad.
TEST(DcStateFeedback, WithoutAnIntegralALoadLeavesAnError) {
  const ServoGains gains = ServoGains::placed(placed_polynomial<2>({100.0, 100.0}), kFriction);
  for (const double expected_rad : {0.058333, 0.10314}) {
    const bool ideal = expected_rad < 0.1;
    DcStateFeedback controller({.axis = ideal ? kAxis : observed(500.0), .position = gains});
    double last_rad = 0.0;
    run(controller, kRest, 0.3, kLoad_nm,
        [&](double, double error_rad, double, double) { last_rad = error_rad; });
    EXPECT_NEAR(last_rad, expected_rad, (ideal ? 0.01 : 0.02) * expected_rad);
  }
}

// AC-13. Catches: feed-forward that nested loops do not have and gains in the wrong loop: 500 rad/s² are
// missed by a·Σr r.../r³ = 0.15 rad, a constant load by nothing.
TEST(DcNestedLoops, LagAnAccelerationAndRemoveALoad) {
  const DcNestedGains gains = DcNestedGains::placed(placed_polynomial<3>({100.0, 100.0, 100.0}), kDcA);
  EXPECT_NEAR(gains.speed_proportional_as_per_rad, 0.251429, 1e-6);
  EXPECT_NEAR(gains.angle_proportional_per_s, 102.2727, 1e-4);
  EXPECT_NEAR(gains.angle_integral_per_s2, 3409.091, 1e-3);
  DcNestedLoops accelerated({.axis = kAxis, .loops = gains});
  // 0.4 s at 500 rad/s².
  const TrapezoidalMove move({.distance_rad = 80.0, .ramp_up_s = 0.4, .cruise_s = 0.0, .ramp_down_s = 0.4});
  double lag_rad = 0.0;
  run(accelerated, move, 0.39, 0.0, [&](double, double e, double, double) { lag_rad = e; });
  EXPECT_NEAR(lag_rad, 0.150, 0.003);
  DcNestedLoops loaded({.axis = kAxis, .loops = gains});
  run(loaded, kRest, 0.4, kLoad_nm, [&](double, double e, double, double) { lag_rad = e; });
  EXPECT_NEAR(lag_rad, 0.0, 1e-5);
}

// CTL-04 with the integral in the speed loop as well: a/K_thI. Catches: an integral in the wrong place.
TEST(DcNestedLoops, WithBothIntegralsTheLagIsTheAccelerationOverTheAngleIntegral) {
  DcNestedGains gains = DcNestedGains::placed(placed_polynomial<3>({100.0, 100.0, 100.0}), kDcA);
  gains.speed_integral_a_per_rad = 5.0;
  DcNestedLoops controller({.axis = kAxis, .loops = gains});
  const TrapezoidalMove move({.distance_rad = 80.0, .ramp_up_s = 0.4, .cruise_s = 0.0, .ramp_down_s = 0.4});
  double lag_rad = 0.0;
  run(controller, move, 0.39, 0.0, [&](double, double e, double, double) { lag_rad = e; });
  EXPECT_NEAR(lag_rad, 500.0 / gains.angle_integral_per_s2, 0.003);
}

// SPD-01: K·K_T/J = 100. Catches: a feed-forward that a proportional loop does not have: a step to 100 rad/s
// leaves f·ω_0/(f + K·K_T) = 6.25 rad/s.
TEST(DcSpeedLoop, AConstantSpeedIsMissedByTheFrictionsShare) {
  DcSpeedLoop controller({.axis = kAxis, .proportional_as_per_rad = 0.0857143});
  const StepMove step({.distance_rad = 0.0, .speed_rad_s = 100.0, .duration_s = 1.0});
  double speed_rad_s = 0.0;
  run(controller, step, 0.2, 0.0, [&](double t, double, double, double w) {
    speed_rad_s = w;
    EXPECT_NEAR(w, 93.75 * -std::expm1(-106.6667 * t), 0.3);
  });
  EXPECT_NEAR(100.0 - speed_rad_s, 6.25, 0.001);
}

// Catches: a current that is fed back: the open loop lets every offset stand and the load take all, 85.897
// rad/s after 0.6 s (problem 2.19).
TEST(DcOpenLoop, DoesNotCompensateALoad) {
  DcOpenLoop controller({.axis = kAxis});
  double speed_rad_s = 0.0;
  run(controller, kRest, 0.6, kLoad_nm, [&](double, double, double, double w) { speed_rad_s = w; });
  EXPECT_NEAR(speed_rad_s, -85.897, 0.01);
}

// CTL-03. Catches: a slip in the quartic's coefficients: the book's numbers for four poles at 300.
TEST(DcVoltageFeedback, HasTheGainsOfFourPolesAt300) {
  const DcVoltageGains gains =
      DcVoltageGains::placed(placed_polynomial<4>({300.0, 300.0, 300.0, 300.0}), kDcA);
  EXPECT_NEAR(gains.integral_a_per_rad_s2, 6.942857e6, 1.0);
  EXPECT_NEAR(gains.proportional_a_per_rad_s, 92571.43, 0.01);
  EXPECT_NEAR(gains.derivative_a_per_rad, 421.0381, 1e-4);
  EXPECT_NEAR(gains.current_per_s, 193.3333, 1e-4);
  DcVoltageFeedbackParameters p = {.axis = observed(3000.0), .position = gains};
  EXPECT_TRUE(p.problems().empty());
  p.position.integral_a_per_rad_s2 = 1e9;
  ASSERT_EQ(p.problems().size(), 1u);
  EXPECT_NE(p.problems()[0].find("unstable"), std::string::npos);
}

// CTL-03. Catches: an error with the wrong sign or in the wrong unit, one at a time; the loop would be stable
// all the same. v = v_ref + L·(...).
TEST(DcVoltageFeedback, EveryErrorGivesTheVoltageOfItsGain) {
  const DcVoltageGains gains =
      DcVoltageGains::placed(placed_polynomial<4>({300.0, 300.0, 300.0, 300.0}), kDcA);
  const auto voltage = [&gains](const Measurement& m, const Reference& r) {
    return DcVoltageFeedback({.axis = kAxis, .position = gains}).update(m, r, 1).a;
  };
  EXPECT_NEAR(voltage({.i_a_a = 1.0}, {}), -2e-3 * 193.3333, 1e-6);
  EXPECT_NEAR(voltage({}, {.angle_rad = 0.01}), 2e-3 * 92571.43 * 0.01, 1e-6);
  // 1 rad/s takes K_b and f/K_T amperes through R, and misses the speed and that current.
  const double current_a = 4e-4 / 0.07;
  EXPECT_NEAR(voltage({}, {.speed_rad_s = 1.0}),
              0.07 + 2.0 * current_a + 2e-3 * (421.0381 + 193.3333 * current_a), 1e-6);
}

/// G = 1/(s·(s + 1)) of the book's classical loops.
constexpr DcMachineModel kUnit = {.resistance_ohm = 1.0,
                                  .inductance_h = 1e-3,
                                  .torque_constant_nm_per_a = 1.0,
                                  .inertia_kgm2 = 1.0,
                                  .friction_nms = 1.0};

// AC-18. Catches: a design formula that is off: K_t = 29, K = 400, a = 5 for −10, −10 ± j10, and 400 A at
// once for a radian. The limit of a < 1 at K = 1 is that of the book's PI without tachometer.
TEST(DcTachometerLoop, HasTheDesignOfTheBook) {
  const DcTachometerGains gains =
      DcTachometerGains::placed(placed_polynomial(10.0, std::sqrt(0.5), std::sqrt(200.0)), kUnit);
  EXPECT_NEAR(gains.speed_as_per_rad, 29.0, 1e-12);
  EXPECT_NEAR(gains.proportional_a_per_rad, 400.0, 1e-12);
  EXPECT_NEAR(gains.zero_per_s, 5.0, 1e-12);
  DcTachometerLoopParameters p = {.axis = kAxis, .loop = gains};
  p.axis.machine = kUnit;
  EXPECT_TRUE(p.problems().empty());
  DcTachometerLoop controller(p);
  EXPECT_NEAR(controller.update({}, {.angle_rad = 1.0}, 1).a, 400.0, 1e-12);
  DcTachometerLoop another(p);  // the speed of the reference is no business of it
  EXPECT_EQ(another.update({}, {.speed_rad_s = 1.0}, 1).a, 0.0);
  p.loop = {.proportional_a_per_rad = 1.0, .zero_per_s = 0.5, .speed_as_per_rad = 0.0};
  EXPECT_TRUE(p.problems().empty());
  p.loop.zero_per_s = 1.0;
  EXPECT_EQ(p.problems().size(), 1u);
}

/// G = 1/(s·(s + 1)) with the loop around it, at 1 kHz.
template <class Visitor>
void run_unit(const DcTachometerGains& gains, const StepMove& move, double duration_s, Visitor visit) {
  DcTachometerLoopParameters p = {.axis = kAxis, .loop = gains};
  p.axis.machine = kUnit;
  p.axis.sample_rate_hz = 1000.0;
  p.axis.shaft.source = ShaftSpeed::kTachometer;
  p.axis.shaft.tachometer_vs_per_rad = 0.1;
  DcTachometerLoop controller(p);
  IdealDcShaft shaft = {.torque_constant_nm_per_a = 1.0, .inertia_kgm2 = 1.0, .friction_nms = 1.0};
  for (int k = 0; k < duration_s * 1e3; ++k) {
    const Reference r = move.at(1e-3 * k);
    visit(1e-3 * k, r.angle_rad - shaft.angle_rad, shaft.angle_rad);
    const Setpoint given = controller.update(
        {.encoder_count = shaft.count(kFineCounts), .tachometer_v = 0.1 * shaft.speed_rad_s}, r, 1);
    shaft.step(given.a, 0.0, 1e-3);
  }
}

// AC-18. Catches: a proportional loop that tracks a ramp: with K = 1 it follows a turn of ω_0 with the error
// ω_0/K, while the PI follows without.
TEST(DcTachometerLoop, AProportionalLoopFollowsARampWithAnError) {
  const StepMove ramp({.distance_rad = 0.0, .speed_rad_s = 0.3, .duration_s = 100.0});
  double last_rad = 0.0;
  const auto look = [&](double, double error_rad, double) { last_rad = error_rad; };
  run_unit({.proportional_a_per_rad = 1.0, .zero_per_s = 0.0, .speed_as_per_rad = 0.0}, ramp, 40.0, look);
  EXPECT_NEAR(last_rad, 0.3, 1e-4);
  run_unit({.proportional_a_per_rad = 1.0, .zero_per_s = 0.5, .speed_as_per_rad = 0.0}, ramp, 90.0, look);
  EXPECT_NEAR(last_rad, 0.0, 1e-4);
}

// CTL-06. Catches: a speed that is fed back as the derivative of the error: a step of the reference then
// gives another zero and another overshoot than 32.77 % at 0.221 s. 2 %: 1 kHz for poles at 14 rad/s.
TEST(DcTachometerLoop, AStepOvershootsByAThird) {
  const StepMove step({.distance_rad = 1.0, .speed_rad_s = 0.0, .duration_s = 10.0});
  double peak_rad = 0.0;
  double peak_s = 0.0;
  run_unit({.proportional_a_per_rad = 400.0, .zero_per_s = 5.0, .speed_as_per_rad = 29.0}, step, 3.0,
           [&](double t, double, double angle_rad) {
             if (angle_rad > peak_rad) {
               peak_rad = angle_rad;
               peak_s = t;
             }
           });
  EXPECT_NEAR(peak_rad, 1.3277, 0.0066);
  EXPECT_NEAR(peak_s, 0.221, 0.003);
}

// CTL-07. Catches: a sine that is followed with an error, a compensator of another frequency: the error is a
// sum of two dying oscillations (the print has 4.7 for 4.458). 1 kHz moves it by a thousandth.
TEST(DcSineLoop, TheErrorOfAKnownSineVanishes) {
  DcSineLoopParameters p = {
      .axis = kAxis, .loop = {.gain_a_s_per_rad = -0.6, .zero_per_s = -0.25, .angular_frequency_rad_s = 1.0}};
  p.axis.machine = kUnit;
  p.axis.sample_rate_hz = 1000.0;
  EXPECT_TRUE(p.problems().empty());
  DcSineLoop controller(p);
  const SineMove sine({.amplitude_rad = 1.0, .angular_frequency_rad_s = 1.0, .duration_s = 100.0});
  IdealDcShaft shaft = {.torque_constant_nm_per_a = 1.0, .inertia_kgm2 = 1.0, .friction_nms = 1.0};
  for (int k = 0; k < 60000; ++k) {
    const double t = 1e-3 * k;
    const Reference r = sine.at(t);
    const double expected_rad = 4.458 * std::exp(-0.1670 * t) * std::sin(0.6283 * t + 0.3728) -
                                4.134 * std::exp(-0.3330 * t) * std::sin(0.4940 * t + 0.4037);
    ASSERT_NEAR(r.angle_rad - shaft.angle_rad, expected_rad, 3e-3) << t;
    shaft.step(controller.update({.encoder_count = shaft.count(kFineCounts)}, r, 1).a, 0.0, 1e-3);
  }
  p.loop.gain_a_s_per_rad = 0.6;
  EXPECT_EQ(p.problems().size(), 1u);
}

// CUR-01. Catches: a regulator that winds up: half a second against the limit, then the voltage leaves it at
// once, and a command beyond the current limit is cut before the error is taken.
TEST(DcCurrentRegulator, DoesNotWindUpAtItsLimits) {
  DcCurrentRegulator regulator({.proportional_v_per_a = 20.0, .integral_v_per_as = 20000.0}, 5.0, 40.0, 1e-4);
  for (int k = 0; k < 5000; ++k) {
    EXPECT_EQ(regulator.step(4.0, 1.0), 40.0);
    EXPECT_TRUE(regulator.saturated());
  }
  EXPECT_NEAR(regulator.step(4.0, 4.5), -10.0, 1e-12);
  EXPECT_FALSE(regulator.saturated());
  DcCurrentRegulator proportional({.proportional_v_per_a = 1.0, .integral_v_per_as = 0.0}, 5.0, 40.0, 1e-4);
  EXPECT_EQ(proportional.step(9.0, 3.0), 2.0);
  EXPECT_TRUE(proportional.saturated());
  EXPECT_EQ(proportional.step(-9.0, 3.0), -8.0);
}

// Catches: an integral of the law that runs on while the current stands at its limit: a load that the limit
// cannot hold, gone after 0.2 s, may not leave a long way back.
TEST(DcStateFeedback, ItsIntegralStandsStillAtTheLimit) {
  DcAxisParameters axis = kAxis;
  axis.current_limit_a = 1.0;
  DcStateFeedback controller({.axis = axis, .position = kTriple});
  for (int k = 0; k < 4000; ++k) {
    EXPECT_EQ(controller.update({}, {.angle_rad = 1.0}, 1).a, 1.0);
    EXPECT_TRUE(controller.saturated());
  }
  // Nothing has been added: back at the reference nothing is asked for.
  EXPECT_EQ(controller.update({}, {}, 1).a, 0.0);
  EXPECT_FALSE(controller.saturated());
}

// Catches: an integral that runs on while the voltage of the controller's own current loop holds the current
// back.
TEST(DcStateFeedback, ItsIntegralStandsStillAtTheVoltageLimit) {
  DcAxisParameters axis = kAxis;
  axis.drive = DcDrive::kOwnRegulator;
  axis.current = {.proportional_v_per_a = 20.0, .integral_v_per_as = 20000.0};
  axis.voltage_limit_v = 5.0;
  DcStateFeedback controller({.axis = axis, .position = kTriple});
  EXPECT_EQ(controller.quantity(), Quantity::kVoltage);
  for (int k = 0; k < 4000; ++k) {
    EXPECT_EQ(controller.update({}, {.angle_rad = -1.0}, 1).a, -5.0);
    EXPECT_TRUE(controller.saturated());
  }
  EXPECT_EQ(controller.update({}, {}, 1).a, 0.0);
}

// Catches: an oscillator that is driven on while the current stands at its limit.
TEST(DcSineLoop, IsNotDrivenBeyondTheLimit) {
  DcSineLoopParameters p = {
      .axis = kAxis, .loop = {.gain_a_s_per_rad = -0.6, .zero_per_s = -0.25, .angular_frequency_rad_s = 1.0}};
  p.axis.machine = kUnit;
  p.axis.sample_rate_hz = 1000.0;
  p.axis.current_limit_a = 0.01;
  DcSineLoop controller(p);
  for (int k = 0; k < 2000; ++k) {
    controller.update({}, {.angle_rad = 1.0}, 1);
    EXPECT_LT(std::abs(controller.telemetry()[0]), 0.03);
  }
}

// Catches: nested loops that are taken although they cannot work: an integral in front of everything else.
TEST(DcNestedLoops, UnstableGainsAreReported) {
  DcNestedLoopsParameters p = {
      .axis = kAxis, .loops = DcNestedGains::placed(placed_polynomial<3>({100.0, 100.0, 100.0}), kDcA)};
  EXPECT_TRUE(p.problems().empty());
  p.loops.speed_integral_a_per_rad = 5.0;
  EXPECT_TRUE(p.problems().empty());
  p.loops.angle_integral_per_s2 = 1e5;
  ASSERT_EQ(p.problems().size(), 1u);
  EXPECT_NE(p.problems()[0].find("unstable"), std::string::npos);
}

// Catches: a current loop at a sample rate that cannot hold it: K_P·T/L of 2 or more.
TEST(DcAxis, ACurrentLoopTooFastForTheSamplesIsReported) {
  DcOpenLoopParameters p = {.axis = kAxis};
  p.axis.drive = DcDrive::kOwnRegulator;
  p.axis.sample_rate_hz = 10000.0;
  p.axis.current = {.proportional_v_per_a = 20.0, .integral_v_per_as = 20000.0};
  EXPECT_TRUE(p.problems().empty());
  p.axis.current.proportional_v_per_a = 40.0;
  ASSERT_EQ(p.problems().size(), 1u);
  EXPECT_NE(p.problems()[0].find("sampled current loop"), std::string::npos);
}

}  // namespace
}  // namespace drivebench::control::dc_controllers_test
