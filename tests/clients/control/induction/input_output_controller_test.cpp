#include "clients/control/induction/input_output_controller.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "plant/math/unbounded.hpp"
#include "tests/clients/control/induction/servo_drive.hpp"

namespace drivebench::control::input_output_controller_test {
namespace {

constexpr InputOutputParameters kGains = {
    .current = {.proportional_v_per_a = 15.0, .integral_v_per_as = 9000.0},
    .position = {.integral_per_s3 = 3.0e5, .proportional_per_s2 = 5.5e4, .derivative_per_s = 125.0},
    .flux = {.proportional_a_per_wb = 100.0, .integral_a_per_wbs = 1e4}};
constexpr FluxReferenceParameters kFlux = {.rated_flux_wb = 0.0455, .base_speed_rad_s = 300.0};

InputOutputController controller_with(TorqueDivisor divisor) {
  InputOutputParameters p = kGains;
  p.divisor = divisor;
  return {kServoDrive, p, kFlux};
}

// Catches: the division by the wrong flux: at half flux linearisation asks for twice the current,
// field-oriented control for what would do at full flux.
TEST(InputOutputController, DividesByTheEstimatedFlux) {
  const double alpha_rad_s2 = 100.0;
  const double per_wb = alpha_rad_s2 / kServoMotor.machine.acceleration_per_wb_a();
  InputOutputController linearising = controller_with(TorqueDivisor::kEstimatedFlux);
  InputOutputController field_oriented = controller_with(TorqueDivisor::kFluxReference);
  for (InputOutputController* controller : {&linearising, &field_oriented}) {
    magnetise(*controller, 0.5 * 0.0455 / 0.0117);
    controller->update({.i_a_a = 0.5 * 0.0455 / 0.0117}, {.acceleration_rad_s2 = alpha_rad_s2});
    EXPECT_NEAR(telemetry_of(*controller, "flux_wb"), 0.5 * 0.0455, 1e-9);
  }
  EXPECT_NEAR(telemetry_of(linearising, "i_q_ref_a"), per_wb / (0.5 * 0.0455), 1e-6);
  EXPECT_NEAR(telemetry_of(field_oriented, "i_q_ref_a"), per_wb / 0.0455, 1e-6);
}

// Catches: a division by no flux: a cold machine is taken for one with 1 mWb.
TEST(InputOutputController, ColdMachineDividesByOneMilliweber) {
  InputOutputController controller = controller_with(TorqueDivisor::kEstimatedFlux);
  controller.update({}, {.acceleration_rad_s2 = 100.0});
  EXPECT_NEAR(telemetry_of(controller, "i_q_ref_a"),
              100.0 / kServoMotor.machine.acceleration_per_wb_a() / 1e-3, 1e-9);
}

// Catches: wind-up while a reference is clipped: fifty samples at the 8 A clip must leave nothing behind.
TEST(InputOutputController, AngleIntegratorStandsStillWhileItsReferenceIsClipped) {
  InductionDriveParameters strong = kServoDrive;
  strong.voltage_limit_v = 1000.0;
  InputOutputController controller(strong, kGains, kFlux);
  const double i_d_a = 0.0455 / 0.0117;
  magnetise(controller, i_d_a);
  for (int k = 0; k < 50; ++k) {
    controller.update({.i_a_a = i_d_a}, {.angle_rad = 1.0});
    EXPECT_EQ(telemetry_of(controller, "i_q_ref_a"), 8.0);
    EXPECT_FALSE(controller.saturated());
  }
  controller.update({.i_a_a = i_d_a}, {});
  EXPECT_NEAR(telemetry_of(controller, "i_q_ref_a"), 0.0, 1e-9);
}

// Catches: wind-up while the amplifier is at its limit, here because of a direct current that is 10 A too
// high; and an integrator that does not run again afterwards.
TEST(InputOutputController, AngleIntegratorStandsStillWhileTheVoltageIsAtItsLimit) {
  InputOutputController controller = controller_with(TorqueDivisor::kFluxReference);
  const double i_d_a = 0.0455 / 0.0117;
  magnetise(controller, i_d_a);
  const auto reference_after = [&](double i_a_a, int samples) {
    for (int k = 0; k < samples; ++k)
      controller.update({.i_a_a = i_a_a}, {.angle_rad = 1e-3});
    return telemetry_of(controller, "i_q_ref_a");
  };
  const double before_a = reference_after(i_d_a + 30.0, 1);
  EXPECT_TRUE(controller.saturated());
  EXPECT_EQ(reference_after(i_d_a + 30.0, 20), before_a);
  EXPECT_GT(reference_after(i_d_a, 20), before_a);
}

// Catches: feedback gains on the wrong error: the response to a step of the reference by one count of a very
// fine encoder, on a machine that gives exactly the currents asked for, is that of s³ + K2·s² + K1·s + K0,
// to the 3 % that Euler steps and one sample of delay take at 50 kHz.
TEST(InputOutputController, AngleLoopHasItsThreePoles) {
  InductionDriveParameters drive = kServoDrive;
  drive.sample_rate_hz = 50e3;
  drive.counts_per_revolution = 1e9;
  drive.motor.machine.friction_nms = 0.01;
  const double h_s = 20e-6;
  InputOutputController controller(drive, kGains, kFlux);
  const InductionMachineModel& m = drive.motor.machine;
  PolarFluxObserver machine(m, h_s);
  double angle_rad = 0.0;
  double speed_rad_s = 0.0;
  Dq i = {.d = 0.0455 / 0.0117, .q = 0.0};
  double e_rad = 1e-3;  // of the characteristic polynomial: e'' = -K2·e' - K1·e - K0·∫e
  double e_rad_s = 0.0;
  double integral_rad_s = 0.0;
  for (int k = -5000; k < 5000; ++k) {
    const TwoPhase phases = to_ab(i, cos_sin_unbounded(machine.angle_rad()));
    controller.update({.encoder_count = std::llround(angle_rad * 1e9 / (2.0 * std::numbers::pi)),
                       .i_a_a = phases.a,
                       .i_b_a = phases.b},
                      {.angle_rad = k < 0 ? 0.0 : 1e-3});
    if (k >= 0) {
      EXPECT_NEAR(1e-3 - angle_rad, e_rad, 3e-5) << k;
    }
    const double alpha_rad_s2 = m.acceleration_per_wb_a() * machine.magnitude_wb() * i.q;
    machine.step(i, speed_rad_s);
    angle_rad += h_s * speed_rad_s;
    speed_rad_s += h_s * (alpha_rad_s2 - m.friction_rate_per_s() * speed_rad_s);
    i = {.d = 0.0455 / 0.0117, .q = telemetry_of(controller, "i_q_ref_a")};
    if (k < 0) continue;
    const double e_rad_s2 = -125.0 * e_rad_s - 5.5e4 * e_rad - 3.0e5 * integral_rad_s;
    integral_rad_s += h_s * e_rad;
    e_rad += h_s * e_rad_s;
    e_rad_s += h_s * e_rad_s2;
  }
}

}  // namespace
}  // namespace drivebench::control::input_output_controller_test
