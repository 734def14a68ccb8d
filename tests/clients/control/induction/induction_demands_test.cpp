#include "clients/control/induction/induction_demands.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "clients/control/induction/torque_optimal_move.hpp"
#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control::induction_demands_test {
namespace {

constexpr MoveAllowance kAmplifier = {.voltage_v = 80.0, .current_a = 6.0};
constexpr VectorLimits kLimits = {.voltage_v = 80.0, .current_a = 6.0};

// Catches: a wrong sign or a missing leakage in the voltages: at the optimum torque the demands of steady
// operation must come out exactly at the limit that is in force, by equations that do not know of it.
TEST(InductionDemands, OptimumOperationStandsAtItsLimits) {
  const SteadyInductionModel m = SteadyInductionModel::of(kServoMotor);
  for (const double speed_rpm : {1000.0, 3150.0, 6000.0, 8000.0}) {
    for (const TorqueSign sign : {TorqueSign::kMotoring, TorqueSign::kGenerating}) {
      const TorquePoint best = optimum_torque(m, kLimits, rad_s(speed_rpm), sign);
      const double friction_rad_s2 = kServoMotor.machine.friction_rate_per_s() * rad_s(speed_rpm);
      const Reference r = {
          .speed_rad_s = rad_s(speed_rpm),
          .acceleration_rad_s2 = best.torque_nm / kServoMotor.machine.inertia_kgm2 - friction_rad_s2};
      const double flux_wb = 0.0117 * best.i_d_a;
      const auto demands =
          InductionDemands(kServoMotor, kAmplifier)
              .at(r, {.flux_wb = flux_wb, .rate_wb_s = 0.0, .second_rate_wb_s2 = 0.0, .i_d_a = 0.0});
      EXPECT_EQ(demands[0].quantity, "stator current");
      EXPECT_EQ(demands[1].quantity, "stator voltage");
      if (best.limit != TorqueLimit::kVoltage) {
        EXPECT_NEAR(demands[0].value, 6.0, 1e-4) << speed_rpm;
      }
      if (best.limit != TorqueLimit::kCurrent) {
        EXPECT_NEAR(demands[1].value, 80.0, 1e-3) << speed_rpm;
      }
      EXPECT_LE(demands[0].value, 6.0001) << speed_rpm;
      EXPECT_LE(demands[1].value, 80.001) << speed_rpm;
    }
  }
}

/// The move to 8000 rpm of 8.2.5 with this friction and flux.
std::optional<Exceeded> exceeded(double friction_nms, FluxPolicy policy) {
  InductionMotorModel motor = kServoMotor;
  motor.machine.friction_nms = friction_nms;
  const auto table =
      std::make_shared<const OptimumTorqueTable>(SteadyInductionModel::of(motor), kLimits, rad_s(8000.0));
  const TorqueOptimalMove move(
      {.top_speed_rad_s = rad_s(8000.0), .run_up_s = 0.38, .run_down_s = 0.265, .torque_ramp_s = 0.030},
      *table, motor.machine);
  const FluxReferenceParameters flux = {.rated_flux_wb = 0.0455,
                                        .base_speed_rad_s = 313.0,
                                        .motoring_share = move.motoring_share(),
                                        .generating_share = move.generating_share(),
                                        .policy = policy};
  return first_exceeded(move, FluxReference(flux, motor.machine, 250e-6, table), 250e-6,
                        InductionDemands(motor, kAmplifier));
}

// Case 11. Catches: a check that lets the infeasible move pass, or refuses the one that the book made: its
// friction takes the torque above the optimum, constant flux takes the voltage above 80 V long before the top
// speed, standard weakening takes the current above 6 A when braking.
TEST(InductionDemands, SaysWhichMovesCannotBeMadeAndWhy) {
  EXPECT_FALSE(exceeded(0.0, FluxPolicy::kOptimumTorque));
  const auto friction = exceeded(1.4e-4, FluxPolicy::kOptimumTorque);
  ASSERT_TRUE(friction);
  EXPECT_EQ(friction->demand.quantity, "stator current");
  EXPECT_LT(friction->time_s, 0.03);
  const auto constant = exceeded(0.0, FluxPolicy::kConstant);
  ASSERT_TRUE(constant);
  EXPECT_EQ(constant->demand.quantity, "stator voltage");
  EXPECT_NEAR(constant->time_s, 0.0995, 0.002);
  const auto weakened = exceeded(0.0, FluxPolicy::kFieldWeakening);
  ASSERT_TRUE(weakened);
  EXPECT_EQ(weakened->demand.quantity, "stator current");
  EXPECT_GT(weakened->time_s, 0.38);
}

}  // namespace
}  // namespace drivebench::control::induction_demands_test
