#include "clients/control/synchronous/optimum_torque_pm.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "tests/clients/control/synchronous/pm_transitions.hpp"

namespace drivebench::control::optimum_torque_pm_test {
namespace {

constexpr PmMachineModel bm500(double torque_constant) {
  return {.pole_pairs = 4.0,
          .resistance_ohm = 0.25,
          .inductance_h = 1.4e-3,
          .torque_constant_nm_per_a = torque_constant,
          .friction_nms = 0.0,
          .inertia_kgm2 = 1.39e-4,
          .star = true};
}
constexpr PmMachineModel kBm500 = bm500(0.162);
constexpr double kVoltage_v = 124.75;
constexpr PmLimits kSmall = {.voltage_v = kVoltage_v, .current_a = 22.05};
constexpr PmLimits kLarge = {.voltage_v = kVoltage_v, .current_a = 67.36};

constexpr double kTwoPerMille = 2e-3;  // the cases allow 0.2 %
constexpr double kText = 0.012;        // the book left out R²I²

double torque(const PmMachineModel& p, const PmLimits& limits, double speed_rad_s, double direction) {
  return optimum_torque(p, limits, speed_rad_s, direction).value().torque_nm;
}

void expect_ratio(double value, double expected, double tolerance) {
  EXPECT_NEAR(value, expected, tolerance * std::abs(expected));
}

// Case 29. Catches: the 2·K_m·K_m·I of the print (E19), the sign of its root between motor and brake, and the
// exchanged labels of the second speeds (E21).
TEST(PmTransitions, AreThoseOfTheBm500) {
  const PmTransitions small = transition_speeds(kBm500, kSmall);
  expect_ratio(small.first_motoring_rad_s, 591.5, kTwoPerMille);
  expect_ratio(small.first_braking_rad_s, 634.5, kTwoPerMille);
  EXPECT_TRUE(small.second_motoring_rad_s.empty());
  EXPECT_TRUE(small.second_braking_rad_s.empty());
  const PmTransitions large = transition_speeds(kBm500, kLarge);
  expect_ratio(large.first_motoring_rad_s, 285.3, kTwoPerMille);
  expect_ratio(large.first_braking_rad_s, 317.7, kTwoPerMille);
  ASSERT_EQ(large.second_motoring_rad_s.size(), 1u);
  ASSERT_EQ(large.second_braking_rad_s.size(), 1u);
  expect_ratio(large.second_motoring_rad_s[0], 340.8, kTwoPerMille);
  expect_ratio(large.second_braking_rad_s[0], 383.4, kTwoPerMille);
  // The book prints these.
  expect_ratio(small.first_motoring_rad_s, 592.0, kText);
  expect_ratio(small.first_braking_rad_s, 635.0, kText);
  expect_ratio(large.first_motoring_rad_s, 288.0, kText);
  expect_ratio(large.first_braking_rad_s, 320.6, kText);
  expect_ratio(large.second_braking_rad_s[0], 383.0, kText);
  // With the constant that it lists (E20).
  const PmTransitions listed = transition_speeds(bm500(0.243), kSmall);
  expect_ratio(listed.first_motoring_rad_s, 440.0, kTwoPerMille);
  expect_ratio(listed.first_braking_rad_s, 476.0, kTwoPerMille);
  const PmTransitions listed_large = transition_speeds(bm500(0.243), kLarge);
  expect_ratio(listed_large.second_motoring_rad_s.at(0), 388.7, kTwoPerMille);
  expect_ratio(listed_large.second_braking_rad_s.at(0), 464.4, kTwoPerMille);
}

// Catches: a second speed that is there for every weak machine: with n_p·L·I below K_m there are two of
// motoring or none, and none of braking (condition (9.94); parameters of the reference's own).
TEST(PmTransitions, AWeakFieldHasTwoSecondSpeedsOrNone) {
  PmMachineModel p = bm500(0.42);
  p.resistance_ohm = 1.0;
  const PmTransitions two = transition_speeds(p, {.voltage_v = 124.8, .current_a = 67.4});
  expect_ratio(two.first_motoring_rad_s, 117.3, kTwoPerMille);
  expect_ratio(two.first_braking_rad_s, 294.9, kTwoPerMille);
  ASSERT_EQ(two.second_motoring_rad_s.size(), 2u);
  expect_ratio(two.second_motoring_rad_s[0], 143.6, kTwoPerMille);
  expect_ratio(two.second_motoring_rad_s[1], 429.2, kTwoPerMille);
  EXPECT_TRUE(two.second_braking_rad_s.empty());
  EXPECT_THROW(transition_speeds(p, {.voltage_v = 67.0, .current_a = 67.4}), std::invalid_argument);
}

// Catches: transition speeds and torques that do not belong together: on both sides of each speed another
// limit is in force.
TEST(PmTransitions, AreWhereTheLimitInForceChanges) {
  const PmTransitions t = transition_speeds(kBm500, kLarge);
  const auto limit = [](double speed, double direction) {
    return optimum_torque(kBm500, kLarge, speed, direction).value().limit;
  };
  EXPECT_EQ(limit(t.first_motoring_rad_s - 0.1, 1.0), LimitInForce::kCurrent);
  EXPECT_EQ(limit(t.first_motoring_rad_s + 0.1, 1.0), LimitInForce::kBoth);
  EXPECT_EQ(limit(t.second_motoring_rad_s[0] - 0.1, 1.0), LimitInForce::kBoth);
  EXPECT_EQ(limit(t.second_motoring_rad_s[0] + 0.1, 1.0), LimitInForce::kVoltage);
  EXPECT_EQ(limit(t.first_braking_rad_s - 0.1, -1.0), LimitInForce::kCurrent);
  EXPECT_EQ(limit(t.first_braking_rad_s + 0.1, -1.0), LimitInForce::kBoth);
  EXPECT_EQ(limit(t.second_braking_rad_s[0] - 0.1, -1.0), LimitInForce::kBoth);
  EXPECT_EQ(limit(t.second_braking_rad_s[0] + 0.1, -1.0), LimitInForce::kVoltage);
}

// Case 30 and its table. Catches: n_p in the wrong place, motoring and braking exchanged.
TEST(PmOptimum, HasTheTorquesOfTheTable) {
  expect_ratio(torque(kBm500, kSmall, 300.0, 1.0), 3.572, kTwoPerMille);  // 3.564 at 22 A
  expect_ratio(torque(kBm500, {kVoltage_v, 22.0}, 300.0, 1.0), 3.564, kTwoPerMille);
  expect_ratio(torque(kBm500, {kVoltage_v, 22.0}, 600.0, 1.0), 3.562, kTwoPerMille);
  expect_ratio(torque(kBm500, {kVoltage_v, 22.0}, 800.0, 1.0), 3.130, kTwoPerMille);
  expect_ratio(torque(kBm500, {kVoltage_v, 22.0}, 800.0, -1.0), -3.300, kTwoPerMille);
  expect_ratio(torque(kBm500, {kVoltage_v, 22.0}, 1000.0, 1.0), 2.610, kTwoPerMille);
  expect_ratio(torque(kBm500, {kVoltage_v, 22.0}, 1000.0, -1.0), -2.816, kTwoPerMille);
  const PmLimits large = {kVoltage_v, 67.4};
  expect_ratio(torque(kBm500, large, 300.0, 1.0), 10.815, kTwoPerMille);
  expect_ratio(torque(kBm500, large, 300.0, -1.0), -10.919, kTwoPerMille);
  expect_ratio(torque(kBm500, large, 400.0, 1.0), 8.453, kTwoPerMille);
  expect_ratio(torque(kBm500, large, 400.0, -1.0), -9.487, kTwoPerMille);
  expect_ratio(torque(kBm500, large, 600.0, 1.0), 5.654, kTwoPerMille);
  expect_ratio(torque(kBm500, large, 600.0, -1.0), -6.347, kTwoPerMille);
  expect_ratio(torque(kBm500, large, 1000.0, 1.0), 3.398, kTwoPerMille);
  expect_ratio(torque(kBm500, large, 1000.0, -1.0), -3.815, kTwoPerMille);
  expect_ratio(torque(bm500(0.243), {kVoltage_v, 22.0}, 1000.0, 1.0), 0.853, 0.01);  // almost none is left
  const PmOptimum at_1000 = optimum_torque(kBm500, {kVoltage_v, 22.0}, 1000.0, 1.0).value();
  expect_ratio(at_1000.current_a.d, -14.98, kTwoPerMille);
  expect_ratio(at_1000.current_a.q, 16.11, kTwoPerMille);
  EXPECT_FALSE(optimum_torque(bm500(0.243), {kVoltage_v, 22.0}, 1100.0, 1.0).has_value());
}

/// The largest torque in a direction, by trying all of both limits; 0 if nothing is allowed.
double by_trying(const PmMachineModel& p, const PmLimits& limits, double speed_rad_s, double direction) {
  double best = 0.0;
  bool any = false;
  const auto take = [&](Dq i) {
    if (std::hypot(i.d, i.q) > limits.current_a * (1.0 + 1e-9)) return;
    if (steady_voltage_v(p, speed_rad_s, i) > limits.voltage_v * (1.0 + 1e-9)) return;
    const double torque_nm = p.torque_constant_nm_per_a * i.q;
    if (!any || direction * torque_nm > direction * best) best = torque_nm;
    any = true;
  };
  constexpr int kAngles = 4000;
  const double x = p.pole_pairs * speed_rad_s * p.inductance_h;
  const double r = p.resistance_ohm;
  const double emf_v = p.torque_constant_nm_per_a * speed_rad_s;
  for (int k = 0; k < kAngles; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / kAngles;
    take({.d = limits.current_a * std::cos(angle), .q = limits.current_a * std::sin(angle)});
    // The currents of a voltage on its limit: u = Z·i + (0, E).
    const double u_d = limits.voltage_v * std::cos(angle);
    const double u_q = limits.voltage_v * std::sin(angle) - emf_v;
    take({.d = (r * u_d + x * u_q) / (r * r + x * x), .q = (r * u_q - x * u_d) / (r * r + x * x)});
  }
  return any ? best : std::nan("");
}

// The self-check. Catches: a branch of the optimum that holds for the machines of the book alone: 400 random
// machines and speeds of both signs against a search over both limits. The search has a grid of 4000 angles,
// at most 2 % of a limit where they meet at a flat angle.
TEST(PmOptimum, AgreesWithASearch) {
  std::mt19937 engine(20051);
  const auto between = [&engine](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  };
  int found = 0;
  for (int n = 0; n < 400; ++n) {
    const PmMachineModel p = {.pole_pairs = std::floor(between(1.0, 9.0)),
                              .resistance_ohm = between(0.1, 2.0),
                              .inductance_h = between(5e-4, 6e-3),
                              .torque_constant_nm_per_a = between(0.05, 0.6),
                              .friction_nms = 0.0,
                              .inertia_kgm2 = 1e-4};
    const PmLimits limits = {.voltage_v = between(40.0, 200.0), .current_a = between(3.0, 60.0)};
    const double speed = between(-1000.0, 1000.0);
    for (const double direction : {1.0, -1.0}) {
      const auto optimum = optimum_torque(p, limits, speed, direction);
      const double searched = by_trying(p, limits, speed, direction);
      ASSERT_EQ(optimum.has_value(), !std::isnan(searched)) << "machine " << n;
      if (!optimum) continue;
      ++found;
      const double scale = p.torque_constant_nm_per_a * limits.current_a;
      EXPECT_NEAR(optimum->torque_nm, searched, 2e-2 * scale) << "machine " << n;
      EXPECT_GE(direction * optimum->torque_nm, direction * searched - 1e-9 * scale) << "machine " << n;
      EXPECT_LE(std::hypot(optimum->current_a.d, optimum->current_a.q), limits.current_a * (1.0 + 1e-9));
      EXPECT_LE(steady_voltage_v(p, speed, optimum->current_a), limits.voltage_v * (1.0 + 1e-9));
    }
  }
  EXPECT_GT(found, 300);
}

// Catches: the root of the larger |i_d|, and one that does not reach the limit.
TEST(PmOptimum, DirectCurrentIsTheSmallestThatTheVoltageAllows) {
  EXPECT_EQ(direct_current_within_voltage_a(kBm500, kVoltage_v, 300.0, 20.0), 0.0);
  for (const double speed : {-1000.0, 900.0}) {
    const double i_d = direct_current_within_voltage_a(kBm500, kVoltage_v, speed, 10.0);
    EXPECT_NEAR(steady_voltage_v(kBm500, speed, {i_d, 10.0}), kVoltage_v, 1e-9);
    EXPECT_GT(steady_voltage_v(kBm500, speed, {i_d + 0.01, 10.0}), kVoltage_v);
    EXPECT_LT(i_d, 0.0);
  }
}

// Catches: rows that are off by one, and a torque of the wrong sign for negative speeds: between its points
// i_q is within 0.02 A of 67, and braking is braking in both directions.
TEST(PmTorqueTable, IsTheOptimumBetweenItsPointsToo) {
  const PmTorqueTable table(kBm500, kLarge, 1000.0, 501);
  for (double speed = -1000.0; speed <= 1000.0; speed += 13.7) {
    for (const double direction : {1.0, -1.0}) {
      const PmOptimum exact = optimum_torque(kBm500, kLarge, speed, direction).value();
      const Dq i = table.current_a(speed, direction);
      EXPECT_NEAR(i.q, exact.current_a.q, 0.02) << speed;
      EXPECT_NEAR(i.d, exact.current_a.d, 0.25) << speed;  // infinitely steep where the limits part
    }
  }
  EXPECT_EQ(table.current_a(2000.0, 1.0).q, table.current_a(1000.0, 1.0).q);
  EXPECT_THROW(PmTorqueTable(bm500(0.243), kSmall, 1100.0, 10), std::invalid_argument);
  EXPECT_THROW(PmTorqueTable(kBm500, kSmall, 1000.0, 1), std::invalid_argument);
}

}  // namespace
}  // namespace drivebench::control::optimum_torque_pm_test
