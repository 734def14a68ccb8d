#include "clients/control/synchronous/bldc_controller.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace drivebench::control::bldc_controller_test {
namespace {

constexpr double kDegree_rad = std::numbers::pi / 180.0;

// AC-27. Catches: a sector of the table with a wrong sign or turned by 60 degrees: over the whole turn the
// torque -tau Σ e_k c_k is 2 tau without ripple, and the currents sum to 0.
TEST(Commutation, GivesAConstantTorque) {
  double square = 0.0;
  for (int k = 0; k < 3600; ++k) {
    const double angle = (0.1 * k + 0.05) * kDegree_rad;
    const Phases e = trapezoids(angle);
    const Phases i = commutation_currents(commutation_sector(angle));
    EXPECT_NEAR(-(e[0] * i[0] + e[1] * i[1] + e[2] * i[2]), 2.0, 1e-9) << k;
    EXPECT_EQ(i[0] + i[1] + i[2], 0.0);
    square += e[0] * e[0];
  }
  EXPECT_NEAR(std::sqrt(square / 3600.0), 0.88192, 1e-5);
}

// Catches: sectors that do not wrap: angles of many turns in both directions.
TEST(Commutation, HasTheSameSectorsInEveryTurn) {
  for (int turn = -3; turn <= 3; ++turn) {
    for (int sector = 0; sector < 6; ++sector) {
      const double middle = (360.0 * turn + 60.0 * sector) * kDegree_rad;
      EXPECT_EQ(commutation_sector(middle - 29.9 * kDegree_rad), sector);
      EXPECT_EQ(commutation_sector(middle + 29.9 * kDegree_rad), sector);
    }
  }
}

// Catches: a sector that is no row of the table: an estimate of the angle that runs away ended the program.
TEST(Commutation, HasARowForEveryAngle) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double angle :
       {kInfinity, -kInfinity, std::numeric_limits<double>::quiet_NaN(), 1e18, -1e18, 1e300, -1e300}) {
    const int sector = commutation_sector(angle);
    EXPECT_GE(sector, 0) << angle;
    EXPECT_LT(sector, 6) << angle;
  }
}

// Catches: a Hall line in another place than its sensor: line k is high from -30 to 150 degrees after
// (k - 1) 120 degrees.
TEST(Commutation, GivesTheSameSectorFromHallLinesAndEncoder) {
  for (int degree = -25; degree < 335; degree += 10) {
    std::uint64_t lines = 0;
    for (int k = 0; k < 3; ++k) {
      const int into = ((degree - 120 * k + 30) % 360 + 360) % 360;
      if (into < 180) lines |= 1u << k;
    }
    const auto sector = commutation_sector(lines);
    ASSERT_TRUE(sector.has_value()) << degree;
    EXPECT_EQ(*sector, commutation_sector(degree * kDegree_rad)) << degree;
  }
  EXPECT_FALSE(commutation_sector(std::uint64_t{0}).has_value());
  EXPECT_FALSE(commutation_sector(std::uint64_t{7}).has_value());
  EXPECT_FALSE(commutation_sector(std::uint64_t{9}).has_value());
}

constexpr BldcParameters kServo = {.machine = {.pole_pairs = 1.0,
                                               .resistance_ohm = 0.7,
                                               .torque_constant_nm_per_a = 0.5128,
                                               .friction_nms = 0.002,
                                               .inertia_kgm2 = 2e-4},
                                   .sample_rate_hz = 1e4,
                                   .counts_per_revolution = 3600.0,
                                   .voltage_limit_v = 200.0,
                                   .current_limit_a = 10.0,
                                   .position = ServoGains::placed(50.0, 50.0, 50.0),
                                   .current = {.proportional_v_per_a = 6.0, .integral_v_per_as = 1000.0},
                                   .speed_observer = SpeedObserverGains::placed(500.0, 500.0, 10.0),
                                   .angle_lead_samples = 0.0};

// BL-04. Catches: a factor 2 in the torque of two phases, and poles in the wrong order: I_p is J/(2 tau)
// times the acceleration, and 150, 7500, 125000 are three poles at -50.
TEST(BldcController, CommandsTheCurrentOfItsAcceleration) {
  BldcController controller(kServo);
  const Setpoint out = controller.update({}, {.angle_rad = 0.01, .acceleration_rad_s2 = 100.0});
  const double expected = 2e-4 / (2.0 * 0.5128) * (100.0 + 7500.0 * 0.01);
  EXPECT_NEAR(out.b, expected, 1e-12);
  EXPECT_NEAR(out.c, -expected, 1e-12);
  EXPECT_EQ(out.a, 0.0);
  const Setpoint next = controller.update({}, {.angle_rad = 0.01, .acceleration_rad_s2 = 100.0});
  EXPECT_NEAR(next.b - out.b, 2e-4 / (2.0 * 0.5128) * 125000.0 * 0.01 * 1e-4, 1e-12);
}

// Catches: an integral that winds up at the current limit, and a torque out of nothing when the Hall lines
// are broken.
TEST(BldcController, StopsAtItsLimitsAndWithoutASector) {
  BldcParameters p = kServo;
  p.commutation = CommutationBy::kHall;
  BldcController controller(p);
  for (int k = 0; k < 1000; ++k) {
    const Setpoint out = controller.update({.hall_lines = 5}, {.angle_rad = 1e3});
    EXPECT_EQ(out.b, 10.0);
    EXPECT_TRUE(controller.saturated());
  }
  EXPECT_EQ(controller.update({.hall_lines = 5}, {}).b, 0.0);
  const Setpoint broken = controller.update({.hall_lines = 7}, {.angle_rad = 1e3});
  EXPECT_EQ(broken.a, 0.0);
  EXPECT_EQ(broken.b, 0.0);
  EXPECT_EQ(broken.c, 0.0);
}

// Catches: an emf fed forward with the wrong sign, and a common voltage that costs headroom: turning without
// current, the voltages between the terminals are those of -e_p w e.
TEST(BldcController, FeedsTheEmfForward) {
  BldcParameters p = kServo;
  p.drive = Quantity::kVoltage;
  p.position = {.integral_per_s3 = 0.0, .proportional_per_s2 = 0.0, .derivative_per_s = 0.0};
  p.speed_observer = SpeedObserverGains::placed(500.0, 500.0, 0.0);
  p.machine.friction_nms = 0.0;
  BldcController controller(p);
  Setpoint out;
  std::int64_t count = 0;
  for (int k = 0; k < 2000; ++k)
    out = controller.update({.encoder_count = count += 11}, {});  // 191.99 rad/s
  const double emf_v = 0.5128 * 11.0 * 1e4 * 2.0 * std::numbers::pi / 3600.0;
  const Phases e = trapezoids(2.0 * std::numbers::pi * static_cast<double>(count % 3600) / 3600.0);
  EXPECT_NEAR(out.a - out.b, -emf_v * (e[0] - e[1]), 0.01);
  EXPECT_NEAR(out.b - out.c, -emf_v * (e[1] - e[2]), 0.01);
  EXPECT_NEAR(std::max({out.a, out.b, out.c}) + std::min({out.a, out.b, out.c}), 0.0, 1e-9);
}

}  // namespace
}  // namespace drivebench::control::bldc_controller_test
