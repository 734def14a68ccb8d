#include "clients/control/synchronous/wound_rotor_controller.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace drivebench::control::wound_rotor_controller_test {
namespace {

constexpr WoundRotorModel kMotor = {.pole_pairs = 2.0,
                                    .stator_resistance_ohm = 2.0,
                                    .stator_inductance_h = 0.12,
                                    .field_resistance_ohm = 40.0,
                                    .field_inductance_h = 6.0,
                                    .mutual_inductance_h = 0.8,
                                    .friction_nms = 1e-3,
                                    .inertia_kgm2 = 0.02};
constexpr WoundRotorParameters kServo = {
    .machine = kMotor,
    .sample_rate_hz = 1e4,
    .counts_per_revolution = 8000.0,
    .voltage_limit_v = 1e6,
    .field_voltage_limit_v = 1e6,
    .current_limit_a = 15.0,
    .field_current_a = 1.0,
    .base_speed_rad_s = 100.0,
    .current = {.bandwidth_per_s = 800.0, .integral_rate_per_s = 0.0},
    .position = {.integral_per_s3 = 0.0, .proportional_per_s2 = 0.0, .derivative_per_s = 0.0},
    .speed_observer = SpeedObserverGains::placed(500.0, 500.0, 0.05),
    .angle_lead_samples = 0.0};

struct Slopes {
  double d, q, field;
};

/// The slopes of the currents under these voltages: SM-03 solved for them.
Slopes machine(double i_d, double i_q, double i_field, double speed_rad_s, double u_d, double u_q,
               double u_field) {
  const double omega = kMotor.pole_pairs * speed_rad_s;
  const double l = kMotor.stator_inductance_h;
  const double m = kMotor.mutual_inductance_h;
  const double l_field = kMotor.field_inductance_h;
  const double d_v = u_d - kMotor.stator_resistance_ohm * i_d + omega * l * i_q;
  const double field_v = u_field - kMotor.field_resistance_ohm * i_field;
  const double determinant = l * l_field - m * m;
  return {.d = (l_field * d_v - m * field_v) / determinant,
          .q = (u_q - kMotor.stator_resistance_ohm * i_q - omega * (l * i_d + m * i_field)) / l,
          .field = (l * field_v - m * d_v) / determinant};
}

// Catches: a coupling of field and d axis that is left in, or undone with the wrong sign: at standstill and
// turning, each current goes to its reference with the bandwidth, and the others stay.
TEST(WoundRotorController, DrivesEachCurrentAlone) {
  for (const std::int64_t counts : {0, 10}) {
    WoundRotorController controller(kServo);
    Setpoint out;
    std::int64_t count = 0;
    const Measurement at_rest = {.i_a_a = 0.0, .i_b_a = 0.0, .i_f_a = 0.7};
    for (int k = 0; k < 4000; ++k) {  // 10 counts are 78.54 rad/s; 40 000 counts are five whole turns
      Measurement m = at_rest;
      m.encoder_count = count += counts;
      // 0.5 and 2 A along and across the field, wherever it stands
      const double angle = 2.0 * 2.0 * std::numbers::pi * static_cast<double>(count % 8000) / 8000.0;
      m.i_a_a = 0.5 * std::cos(angle) - 2.0 * std::sin(angle);
      m.i_b_a = 0.5 * std::sin(angle) + 2.0 * std::cos(angle);
      out = controller.update(m, {});
    }
    ASSERT_FALSE(controller.saturated());
    const double speed = controller.speed_rad_s();
    const double i_q_ref = controller.telemetry()[2];
    // The disc is back at 0: phase a is d, phase b is q.
    const Slopes s = machine(0.5, 2.0, 0.7, speed, out.a, out.b, out.field);
    EXPECT_NEAR(s.d, 800.0 * (0.0 - 0.5), 1e-6) << counts;
    EXPECT_NEAR(s.q, 800.0 * (i_q_ref - 2.0), 1e-6) << counts;
    EXPECT_NEAR(s.field, 800.0 * (1.0 - 0.7), 1e-6) << counts;
  }
}

// Catches: n_p left out of the torque (E27), and a torque per ampere of the field that is wanted instead of
// the one that is there.
TEST(WoundRotorController, DividesTheTorqueByThePresentField) {
  WoundRotorController controller(kServo);
  controller.update({.i_f_a = 0.5}, {.acceleration_rad_s2 = 100.0});
  EXPECT_NEAR(controller.telemetry()[2], 0.02 * 100.0 / (2.0 * 0.8 * 0.5), 1e-12);
  controller.update({.i_f_a = 0.0}, {.acceleration_rad_s2 = 1.0});
  EXPECT_NEAR(controller.telemetry()[2], 0.02 / (2.0 * 0.8 * 0.05), 1e-12);
}

// Catches: weakening that begins at the wrong speed or is the same in one direction only.
TEST(WoundRotorController, WeakensTheFieldAboveTheBaseSpeed) {
  for (const std::int64_t counts : {-26, 26, 5}) {
    WoundRotorController controller(kServo);
    std::int64_t count = 0;
    for (int k = 0; k < 3000; ++k)
      controller.update({.encoder_count = count += counts, .i_f_a = 1.0}, {});
    const double speed = std::abs(static_cast<double>(counts)) * 2.0 * std::numbers::pi / 8000.0 * 1e4;
    EXPECT_NEAR(controller.telemetry()[3], std::min(1.0, 100.0 / speed), 1e-3);
  }
}

// Catches: a voltage limit that takes from d and q alike: at the limit the d axis keeps what it needs.
TEST(WoundRotorController, GivesTheDirectAxisTheVoltageFirst) {
  WoundRotorParameters p = kServo;
  p.voltage_limit_v = 100.0;
  WoundRotorController controller(p);
  const Setpoint out =
      controller.update({.i_a_a = 0.5, .i_b_a = 0.0, .i_f_a = 1.0}, {.acceleration_rad_s2 = 800.0});
  EXPECT_TRUE(controller.saturated());
  EXPECT_NEAR(out.a, 2.0 * 0.5 - 800.0 * 0.5 * (0.12 - 0.8 * 0.0), 1e-9);
  EXPECT_NEAR(std::hypot(out.a, out.b), 100.0, 1e-9);
}

// Catches: a machine whose inductances no magnet circuit can have.
TEST(WoundRotorParameters, LimitTheMutualInductance) {
  WoundRotorParameters p = kServo;
  EXPECT_TRUE(p.problems().empty());
  p.machine.mutual_inductance_h = 0.85;
  EXPECT_EQ(p.problems().size(), 1u);
}

}  // namespace
}  // namespace drivebench::control::wound_rotor_controller_test
