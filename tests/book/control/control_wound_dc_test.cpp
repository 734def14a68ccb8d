// Machines with a wound field under feedback linearisation (problems 2.40 to 2.47), on the product's own
// bench. The book has no numbers: the tests check what the laws guarantee.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/book/closed_loop.hpp"

namespace drivebench::control_wound_dc_test {
namespace {

using control::Gain;

/// The largest speed error between two times.
double peak_speed_error(const Outcome& seen, double from_s, double to_s) {
  double peak = 0.0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s < from_s || row.time_s >= to_s) continue;
    peak = std::max(peak, std::abs(row.reference.speed_rad_s - row.sample.speed_rad_s));
  }
  return peak;
}

double final_speed(const Outcome& seen) {
  return seen.rows.back().sample.speed_rad_s;
}

// CTL-08, DC-07. Catches: a remaining coupling of the field into the speed: on the way to 300 rad/s the field
// falls to three fifths without an effect on the speed, on a saturated machine.
TEST(WoundDcControl, ArmatureAndFieldTogetherGoBeyondTheBaseSpeed) {
  const Outcome seen = closed_loop("book/2.40");
  EXPECT_LT(peak_speed_error(seen, 0.0, 3.0), 0.1);
  const double base_wb = 20.5;
  const double final_wb = seen.rows.back().telemetry[seen.column("flux_wb")];
  EXPECT_NEAR(final_wb, base_wb * 180.0 / 300.0, 0.02);
  EXPECT_LT(seen.peak_voltage_v, 210.0);
  EXPECT_LT(seen.peak_current_a, 8.0);
}

// CTL-08. Catches: an integral that does not balance a load: 5 N·m at speed leave no error after half a
// second, and a machine with a resistance half as large again is still held.
TEST(WoundDcControl, ALoadAndAWarmArmatureAreTaken) {
  const Outcome loaded = closed_loop("book/2.40", {}, {{"move.speed_rad_s", 150.0}}, {{5.0, 2.2}});
  EXPECT_GT(peak_speed_error(loaded, 2.2, 3.0), 2.0);
  EXPECT_LT(peak_speed_error(loaded, 2.8, 3.0), 0.1);
  const Outcome warm = closed_loop("book/2.40", {.parameters = {{"machine.armature_resistance_ohm", 4.5}}});
  EXPECT_LT(peak_speed_error(warm, 0.0, 3.0), 2.0);
}

// CTL-09. Catches: a law that moves the armature voltage: above the start the field alone brings the machine
// to 300 rad/s.
TEST(WoundDcControl, TheFieldAloneControlsTheSpeedAtConstantVoltage) {
  const Outcome seen = closed_loop("book/2.41");
  EXPECT_NEAR(final_speed(seen), 300.0, 0.2);
  EXPECT_LT(peak_speed_error(seen, 2.5, 6.0), 3.0);
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s > 2.5) {
      ASSERT_EQ(row.setpoint.a, 220.0) << row.time_s;
    }
  }
}

// CTL-10. Catches: a start that fails at zero current, a torque that is not proportional to the square of the
// current.
TEST(WoundDcControl, TheSeriesMotorFollowsItsRampUnderAFan) {
  const Outcome seen = closed_loop("book/2.42");
  EXPECT_LT(peak_speed_error(seen, 0.0, 3.0), 2.0);
  EXPECT_NEAR(final_speed(seen), 150.0, 0.05);
}

// EST-06. Catches: a speed that still comes from the shaft: the controller gets a wrong encoder, and keeps
// within 3 rad/s by the current alone, from which it also finds the load.
TEST(WoundDcControl, TheSeriesMotorRunsWithoutASensorOnItsShaft) {
  const Outcome seen = closed_loop("book/2.45", {}, {{"counts_per_revolution", 500.0}});
  EXPECT_LT(peak_speed_error(seen, 0.0, 3.0), 3.0);
  EXPECT_NEAR(final_speed(seen), 150.0, 0.2);
  // The fan takes 1e-4·150² = 2.25 N·m.
  EXPECT_NEAR(0.02 * seen.rows.back().telemetry[seen.column("load_rad_s2")], 2.25, 0.05);
}

// EST-05. Catches: a load that the observer of two states knows after all, or gains that are not those of its
// poles: a load leaves ω̂ − ω = l1·τ_L/(J·p1·p2), with the fan at the speed that results 2.7 rad/s.
TEST(WoundDcControl, TheSeriesMotorIsTooSlowByTheLoadThatItsObserverIgnores) {
  const Outcome seen = closed_loop("book/2.44", {}, {{"counts_per_revolution", 500.0}});
  const double true_rad_s = final_speed(seen);
  const double fan_nm = 1e-4 * true_rad_s * true_rad_s;
  const double l1_per_s = 160.0 - 1e-3 / 0.02;
  const double expected_rad_s = l1_per_s * fan_nm / (0.02 * 80.0 * 80.0);
  EXPECT_NEAR(expected_rad_s, 2.7, 0.05);
  EXPECT_NEAR(seen.rows.back().speed_estimate_rad_s - true_rad_s, expected_rad_s, 0.02 * expected_rad_s);
  EXPECT_NEAR(150.0 - true_rad_s, expected_rad_s, 0.05 * expected_rad_s);
}

// CTL-11. Catches: a flux that leaves its two bounds, or loses them under a fan.
TEST(WoundDcControl, TheWeakenedSeriesMotorKeepsItsFlux) {
  const Outcome seen = closed_loop("book/2.43");
  EXPECT_LT(peak_speed_error(seen, 0.0, 3.0), 5.0);
  EXPECT_NEAR(final_speed(seen), 150.0, 0.3);
  EXPECT_LT(seen.peak_of("flux_wb"), 0.9);
  EXPECT_LT(seen.peak_field_current_a, seen.peak_current_a);  // the rest goes through R_p
}

// CTL-12. Catches: references that do not belong to the load: the exact law must come to rest at 100 rad/s,
// and closer on the way than the input-output law.
TEST(WoundDcControl, TheShuntMotorIsLinearInBothStates) {
  const Outcome seen = closed_loop("book/2.46");
  EXPECT_LT(peak_speed_error(seen, 0.0, 4.0), 4.0);
  EXPECT_NEAR(final_speed(seen), 100.0, 0.1);
}

// CTL-13. Catches: a shunt machine without a limit speed: up to R_F/(K_m·L_f) = 191.3 rad/s its flux is
// bounded, above only the voltage limit bounds it, and the speed is not held.
TEST(WoundDcControl, TheShuntMotorHasABoundedFluxBelowItsLimitSpeedOnly) {
  const Outcome seen = closed_loop("book/2.47");
  EXPECT_NEAR(final_speed(seen), 100.0, 0.2);
  const double flux_wb = seen.rows.back().telemetry[seen.column("flux_wb")];
  EXPECT_NEAR(flux_wb, 8.11, 0.05);  // √(τ·R/(K_m·(R_F/L_f − K_m·ω))) with 5 N·m
  const Outcome beyond = closed_loop("book/2.47", {}, {{"move.speed_rad_s", 210.0}, {"move.cruise_s", 3.0}});
  EXPECT_GT(beyond.saturated_samples, 1000);
  EXPECT_EQ(beyond.peak_voltage_v, 220.0);
  EXPECT_LT(final_speed(beyond), 200.0);
}

// Catches: limits that are not checked before a move of these machines.
TEST(WoundDcControl, AMoveBeyondTheLimitsIsRefused) {
  const auto refusal = [](const char* preset, const Gain& gain) -> std::string {
    try {
      closed_loop(preset, {}, {gain});
    } catch (const std::invalid_argument& refused) {
      return refused.what();
    }
    return {};
  };
  EXPECT_NE(refusal("book/2.40", {"move.ramp_s", 0.3}).find("armature current"), std::string::npos);
  EXPECT_NE(refusal("book/2.42", {"move.ramp_s", 0.2}).find("armature"), std::string::npos);
  EXPECT_NE(refusal("book/2.40", {"speed.integral_per_s3", 1e6}).find("unstable"), std::string::npos);
  EXPECT_NE(refusal("book/2.45", {"current_observer.load_per_s3", -1e6}).find("unstable"), std::string::npos);
}

}  // namespace
}  // namespace drivebench::control_wound_dc_test
