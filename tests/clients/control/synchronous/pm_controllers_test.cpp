#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "clients/control/math/polynomial.hpp"
#include "clients/control/presets/presets.hpp"
#include "clients/control/synchronous/pm_current_controller.hpp"
#include "clients/control/synchronous/pm_references.hpp"
#include "clients/control/synchronous/pm_speed_controller.hpp"
#include "clients/control/synchronous/pm_voltage_controller.hpp"

namespace drivebench::control::pm_controllers_test {
namespace {

constexpr PmMachineModel kStepper = {.pole_pairs = 50.0,
                                     .resistance_ohm = 0.55,
                                     .inductance_h = 1.5e-3,
                                     .torque_constant_nm_per_a = 0.19,
                                     .friction_nms = 8e-4,
                                     .inertia_kgm2 = 4.5e-5};
constexpr PmFeedbackGains kPrinted = {.direct_per_s = 1.06e4,
                                      .quadrature_per_s = 1.78e4,
                                      .speed_a_per_rad = 340.0,
                                      .angle_a_per_rad_s = 3.8e6,
                                      .integral_a_per_rads2 = 1.07e7};
constexpr PmVoltageParameters kServo = {.machine = kStepper,
                                        .sample_rate_hz = 10e3,
                                        .counts_per_revolution = 2000.0,
                                        .voltage_limit_v = 1e6,
                                        .feedback = kPrinted,
                                        .speed_observer = {.angle_per_s = 5272.0, .speed_per_s2 = 7.0e6}};

// Catches: a misprint among the references: they must satisfy the machine's own equations, with slopes that
// are those of the currents along the 1.8 mm move. Central differences over 2 us: 1e-5.
TEST(PmReferences, SatisfyTheMachine) {
  const TrajectoryParameters move = {
      .distance_rad = 0.9 * std::numbers::pi, .ramp_up_s = 0.01, .cruise_s = 0.01, .ramp_down_s = 0.01};
  constexpr double kStep_s = 1e-6;
  for (const double t : {0.001, 0.004, 0.007, 0.015, 0.023, 0.029}) {
    const Reference r = trajectory_at(move, t);
    const PmReferences ref = pm_references(kStepper, r);
    const PmReferences before = pm_references(kStepper, trajectory_at(move, t - kStep_s));
    const PmReferences after = pm_references(kStepper, trajectory_at(move, t + kStep_s));
    const double slope_d = (after.current_a.d - before.current_a.d) / (2.0 * kStep_s);
    const double slope_q = (after.current_a.q - before.current_a.q) / (2.0 * kStep_s);
    EXPECT_NEAR(ref.slope_a_per_s.d, slope_d, 1e-5 * std::abs(slope_d) + 1e-3) << t;
    EXPECT_NEAR(ref.slope_a_per_s.q, slope_q, 1e-5 * std::abs(slope_q) + 1e-3) << t;
    const double x = kStepper.pole_pairs * r.speed_rad_s * kStepper.inductance_h;
    EXPECT_NEAR(ref.voltage_v.d,
                kStepper.inductance_h * ref.slope_a_per_s.d + kStepper.resistance_ohm * ref.current_a.d -
                    x * ref.current_a.q,
                1e-9);
    EXPECT_NEAR(ref.voltage_v.q,
                kStepper.inductance_h * ref.slope_a_per_s.q + kStepper.resistance_ohm * ref.current_a.q +
                    x * ref.current_a.d + kStepper.torque_constant_nm_per_a * r.speed_rad_s,
                1e-9);
    EXPECT_NEAR(kStepper.inertia_kgm2 * r.acceleration_rad_s2,
                kStepper.torque_constant_nm_per_a * ref.current_a.q - kStepper.friction_nms * r.speed_rad_s,
                1e-9);
  }
}

// Case 26. Catches: n_p left out of the lead angle: i_d at 141.4 and 314.2 rad/s, and no other i_d takes less
// voltage there.
TEST(PmReferences, TheLeadAngleTakesTheLeastVoltage) {
  EXPECT_NEAR(optimal_direct_current_a(kStepper, 141.37), -2.527, 1e-3);
  EXPECT_NEAR(optimal_direct_current_a(kStepper, 314.16), -2.532, 1e-3);
  const auto voltage = [](double i_d, double w) {
    const double x = kStepper.pole_pairs * w * kStepper.inductance_h;
    return std::hypot(kStepper.resistance_ohm * i_d - x * 1.0,
                      kStepper.resistance_ohm * 1.0 + x * i_d + kStepper.torque_constant_nm_per_a * w);
  };
  const double i_d = optimal_direct_current_a(kStepper, 200.0);
  EXPECT_LT(voltage(i_d, 200.0), voltage(i_d + 0.01, 200.0));
  EXPECT_LT(voltage(i_d, 200.0), voltage(i_d - 0.01, 200.0));
}

/// The voltages, d along phase a, at rest at count 0 with these currents; the second sample, so that a
/// change of the count counts.
Setpoint answer(double i_d_a, double i_q_a, double reference_rad = 0.0, double speed_rad_s = 0.0) {
  PmVoltageController controller(kServo);
  return controller.update({.i_a_a = i_d_a, .i_b_a = i_q_a},
                           {.angle_rad = reference_rad, .speed_rad_s = speed_rad_s}, 1);
}

// E14. Catches: v with the wrong sign or divided by L_S: at standstill the answer to an error is L_S·K times
// it and opposes it.
TEST(PmVoltageController, FeedsBackLTimesK) {
  const double l = kStepper.inductance_h;
  EXPECT_NEAR(answer(0.1, 0.0).a, -l * 1.06e4 * 0.1, 1e-9);
  EXPECT_NEAR(answer(0.0, 0.1).b, -l * 1.78e4 * 0.1, 1e-9);
  EXPECT_NEAR(answer(0.0, 0.0, 1e-3).b, l * 3.8e6 * 1e-3, 1e-9);
  // A speed wanted at standstill: its references and k23 times the error.
  const PmReferences ref = pm_references(kStepper, {.speed_rad_s = 1.0});
  const double expected = ref.voltage_v.q + l * (1.78e4 * ref.current_a.q + 340.0 * 1.0) -
                          l * kStepper.pole_pairs * ref.current_a.d;
  EXPECT_NEAR(answer(0.0, 0.0, 0.0, 1.0).b, expected, 1e-9);
}

// Catches: an integral that runs on while a phase is clipped, or does not run at all.
TEST(PmVoltageController, FreezesItsIntegralAtTheLimit) {
  PmVoltageParameters p = kServo;
  p.voltage_limit_v = 40.0;
  p.feedback = {.direct_per_s = 0.0,
                .quadrature_per_s = 0.0,
                .speed_a_per_rad = 0.0,
                .angle_a_per_rad_s = 20.0 / (0.1 * kStepper.inductance_h),
                .integral_a_per_rads2 = 1e9};
  PmVoltageController controller(p);
  // 20 V for the error, and L·k25·T·e = 15 V more each sample.
  const Reference ahead = {.angle_rad = 0.1};
  EXPECT_NEAR(controller.update({}, ahead).b, 20.0, 1e-9);
  EXPECT_NEAR(controller.update({}, ahead).b, 35.0, 1e-9);
  for (int k = 0; k < 10; ++k) {
    EXPECT_EQ(controller.update({}, ahead).b, 40.0);
    EXPECT_TRUE(controller.saturated());
  }
  EXPECT_NEAR(controller.update({}, {.angle_rad = -0.1}).b, 30.0 - 20.0, 1e-9);
  EXPECT_FALSE(controller.saturated());
}

/// A gain of a preset as it stands.
double gain(std::string_view preset, std::string_view name) {
  const std::vector<Gain> gains = find_preset(preset)->gains();
  return std::ranges::find(gains, name, &Gain::name)->value;
}

PmFeedbackGains feedback_of(std::string_view preset) {
  return {.direct_per_s = gain(preset, "feedback.direct_per_s"),
          .quadrature_per_s = gain(preset, "feedback.quadrature_per_s"),
          .speed_a_per_rad = gain(preset, "feedback.speed_a_per_rad"),
          .angle_a_per_rad_s = gain(preset, "feedback.angle_a_per_rad_s"),
          .integral_a_per_rads2 = gain(preset, "feedback.integral_a_per_rads2")};
}

/// Poles of the quadrature axis: (s + R/L + k22)(s + f/J)s² + (K_m/J)((K_m/L + k23)s² + k24·s + k25).
std::vector<std::complex<double>> quadrature_poles(const PmMachineModel& m, const PmFeedbackGains& k) {
  const double a = m.resistance_ohm / m.inductance_h + k.quadrature_per_s;
  const double b = m.friction_rate_per_s();
  const double g = m.acceleration_per_a();
  const std::array<double, 5> polynomial{
      g * k.integral_a_per_rads2, g * k.angle_a_per_rad_s,
      a * b + g * (m.torque_constant_nm_per_a / m.inductance_h + k.speed_a_per_rad), a + b, 1.0};
  auto poles = roots(polynomial);
  std::ranges::sort(poles, {}, [](std::complex<double> z) { return z.real(); });
  return poles;
}

// E15, E16. Catches: a mistyped gain, and k23, k24 that do not belong to the printed poles: as printed, with
// k11 and k22 exchanged and k25 ten times as large, and the gains of the 3000 rpm run with both inertias.
// Two in a thousand of the largest part of a pole.
TEST(PmVoltageController, GainsHaveTheirPoles) {
  const double rate = kStepper.resistance_ohm / kStepper.inductance_h;
  const PmFeedbackGains move = feedback_of("book/9.1.4");
  EXPECT_NEAR(rate + move.direct_per_s, 10967.0, 1.0);
  const auto expect_poles = [](const std::vector<std::complex<double>>& poles, double fast, double slow,
                               double pair_real, double pair_imaginary) {
    EXPECT_NEAR(poles[0].real(), fast, 2e-3 * std::abs(fast));
    double imaginary = 0.0;
    for (std::size_t k = 1; k < 4; ++k) {
      imaginary = std::max(imaginary, poles[k].imag());
      const bool in_pair = std::abs(poles[k].imag()) > 1.0;
      EXPECT_NEAR(poles[k].real(), in_pair ? pair_real : slow, in_pair ? 0.5 : 0.1);
    }
    EXPECT_NEAR(imaginary, pair_imaginary, 2e-3 * pair_imaginary);
  };
  expect_poles(quadrature_poles(kStepper, move), -18107.0, -2.8, -37.5, 940.0);
  PmFeedbackGains swapped = feedback_of("book/9.1.4-swapped");
  EXPECT_NEAR(rate + swapped.direct_per_s, 18167.0, 1.0);
  swapped.integral_a_per_rads2 *= 10.0;
  expect_poles(quadrature_poles(kStepper, swapped), -10920.0, -28.3, -17.9, 1210.0);
  const PmFeedbackGains run = feedback_of("book/9.7-3000rpm-20khz");
  expect_poles(quadrature_poles(kStepper, run), -24722.0, -3.4, -59.4, 705.0);
  PmMachineModel without_table = kStepper;
  without_table.inertia_kgm2 = 2.8e-5;
  without_table.friction_nms = 1.06e-3;
  expect_poles(quadrature_poles(without_table, run), -24664.0, -3.4, -101.0, 893.0);
}

// PMO-01. Catches: the observer of another machine: its poles are -2645 +- j313.5, the book has both at
// -2646.
TEST(PmVoltageController, TheSpeedObserverHasTheBooksPoles) {
  const double l1 = gain("book/9.1.4", "speed_observer.angle_per_s");
  const double rate = kStepper.friction_rate_per_s();
  const double half = 0.5 * (l1 + rate);
  const double product = gain("book/9.1.4", "speed_observer.speed_per_s2") + l1 * rate;
  EXPECT_NEAR(half, 2644.9, 0.1);
  EXPECT_NEAR(std::sqrt(product - half * half), 313.5, 1.0);
}

// E17, E18. Catches: 25 teeth for 50 and a torque constant of a phase: 3000 rpm are 2500 electrical turns a
// second (the print has 1.57 kHz), and the emf at 2000 rpm is 39.8 V (the print has 41).
TEST(PmVoltageController, HasTheMachineOfTheBook) {
  EXPECT_NEAR(gain("book/9.7-3000rpm", "machine.pole_pairs") * 3000.0 / 60.0, 2500.0, 1e-9);
  EXPECT_NEAR(gain("book/9.1.4", "machine.torque_constant_nm_per_a") * 2000.0 / 60.0 * 2.0 * std::numbers::pi,
              39.8, 0.05);
}

// Catches: a two-phase vector at the terminals of a star, and a lead of the wrong sign or in mechanical
// angle: at speed the currents stand n_p·ω·T/2 ahead of the quadrature axis.
TEST(PmCurrentController, PutsTheCurrentAheadOfTheQuadratureAxis) {
  const PmCurrentParameters p = {
      .machine = {.pole_pairs = 4.0,
                  .resistance_ohm = 0.25,
                  .inductance_h = 1.4e-3,
                  .torque_constant_nm_per_a = 0.162,
                  .friction_nms = 0.0,
                  .inertia_kgm2 = 1.39e-4,
                  .star = true},
      .sample_rate_hz = 1e4,
      .counts_per_revolution = 8000.0,
      .voltage_limit_v = 124.75,
      .current_limit_a = 22.05,
      .position = {.integral_per_s3 = 0.0, .proportional_per_s2 = 0.0, .derivative_per_s = 0.0},
      .speed_observer = SpeedObserverGains::placed(1000.0, 1000.0, 0.0)};
  PmCurrentController controller(p);
  const Reference r = {.acceleration_rad_s2 = 10.0 * 0.162 / 1.39e-4};  // 10 A
  Setpoint out = controller.update({}, r);
  EXPECT_NEAR(out.a, 0.0, 1e-12);
  EXPECT_NEAR(out.b, 10.0 / std::numbers::sqrt2, 1e-9);
  EXPECT_NEAR(out.a + out.b + out.c, 0.0, 1e-12);
  std::int64_t count = 0;
  for (int k = 0; k < 2000; ++k)
    out = controller.update({.encoder_count = count += 20}, r);  // 157.08 rad/s
  EXPECT_NEAR(controller.speed_rad_s(), 157.08, 0.01);
  const double electrical_rad =
      4.0 * (2.0 * std::numbers::pi * static_cast<double>(count) / 8000.0 + 0.5 * 157.08e-4);
  const double ahead_a = -std::sqrt(2.0 / 3.0) * 10.0 * std::sin(electrical_rad);
  EXPECT_NEAR(out.a, ahead_a, 1e-3);
}

// Catches: a reference beyond the circle, and an integral that runs on there.
TEST(PmCurrentController, KeepsTheCurrentWithinItsLimit) {
  PmCurrentParameters p = {.machine = kStepper,
                           .sample_rate_hz = 1e4,
                           .counts_per_revolution = 2000.0,
                           .voltage_limit_v = 1e3,
                           .current_limit_a = 6.0,
                           .position = ServoGains::placed(100.0, 100.0, 100.0),
                           .speed_observer = SpeedObserverGains::placed(1000.0, 1000.0, 17.8)};
  PmCurrentController controller(p);
  for (int k = 0; k < 100; ++k) {
    const Setpoint out = controller.update({}, {.angle_rad = 100.0});
    EXPECT_NEAR(std::hypot(out.a, out.b), 6.0, 1e-12);
    EXPECT_TRUE(controller.saturated());
  }
  EXPECT_NEAR(controller.update({}, {}).b, 0.0, 1e-9);
}

// Catches: a speed loop that gives full torque at small errors, and parameters that make no table.
TEST(PmSpeedController, IsProportionalBelowItsLimits) {
  PmSpeedParameters p = {.machine = {.pole_pairs = 4.0,
                                     .resistance_ohm = 0.25,
                                     .inductance_h = 1.4e-3,
                                     .torque_constant_nm_per_a = 0.162,
                                     .friction_nms = 0.0,
                                     .inertia_kgm2 = 1.39e-4,
                                     .star = true},
                         .sample_rate_hz = 20e3,
                         .counts_per_revolution = 8192.0,
                         .voltage_limit_v = 124.75,
                         .current_limit_a = 22.05,
                         .speed_gain_per_s = 2000.0,
                         .max_speed_rad_s = 1050.0,
                         .current = {.proportional_v_per_a = 10.0, .integral_v_per_as = 2000.0},
                         .speed_observer = SpeedObserverGains::placed(3000.0, 3000.0, 0.0)};
  PmSpeedController controller(p);
  controller.update({}, {.speed_rad_s = 1.0});
  EXPECT_NEAR(controller.telemetry()[3], 1.39e-4 * 2000.0 / 0.162, 1e-9);
  controller.update({}, {.speed_rad_s = -100.0});
  EXPECT_NEAR(controller.telemetry()[3], -22.05, 1e-9);
  p.max_speed_rad_s = 5000.0;
  EXPECT_EQ(p.problems().size(), 1u);
  p.voltage_limit_v = 5.0;
  EXPECT_EQ(p.problems().size(), 2u);
}

}  // namespace
}  // namespace drivebench::control::pm_controllers_test
