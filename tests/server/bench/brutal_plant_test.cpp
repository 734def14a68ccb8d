// Loads that destroy real motors: the state stays finite, or the axis reports the divergence.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string_view>

#include "tests/repetitions.hpp"
#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::brutal_plant_test {
namespace {

constexpr Owner kOwner = 7;
constexpr int kTicks = repetitions(200'000);  // a million steps

/// A motor at full speed, turned by a field that it follows.
Bench running_bench() {
  BenchSetup setup = servo_setup();
  setup.lease_ticks = 10 * kTicks;
  setup.watchdog_ticks = 10 * kTicks;
  Bench bench = owned_bench(setup, kOwner);
  for (int tick = 0; tick < 8000; ++tick) {
    const double angle_rad = 2.0 * 3.141592653589793 * 60.0 * kServoTick_s * tick;
    submit_volts(bench, kOwner, 80.0 * std::cos(angle_rad), 80.0 * std::sin(angle_rad));
    bench.step();
  }
  return bench;
}

void expect_finite(const Bench& bench, std::string_view what) {
  const Sample& s = bench.sample(0);
  for (const double value :
       {s.true_i_a_a, s.true_i_b_a, s.speed_rad_s, s.angle_rad, s.torque_nm, s.u_a_v, s.edge_age_s})
    ASSERT_TRUE(std::isfinite(value)) << what << ", tick " << s.tick;
}

void run(Bench& bench, std::string_view what) {
  const std::uint64_t before = bench.sample(0).tick;
  for (int tick = 0; tick < kTicks; ++tick) {
    bench.step();
    ASSERT_NO_FATAL_FAILURE(expect_finite(bench, what));
  }
  EXPECT_EQ(bench.sample(0).faults & kDiverged, 0u) << what;
  EXPECT_EQ(bench.sample(0).tick, before + kTicks);
}

Refused submit(Bench& bench, const Action& action) {
  return bench.submit({.tick = bench.tick(), .axis = 0, .owner = kOwner, .action = action});
}

// Catches: a solver that gains energy under what is legal, however brutal, and a loss that never ends.
TEST(BrutalPlant, CMD_15_AMillionStepsOfEachStayFinite) {
  Bench turning = running_bench();
  ASSERT_GT(turning.sample(0).speed_rad_s, 100.0);

  Bench shorted = running_bench();
  const Command all_low{.answers = shorted.tick(), .phases = {.gates = Gates::kZeroVoltage, .setpoint = {}}};
  ASSERT_EQ(submit(shorted, all_low), Refused::kNot);
  shorted.step();
  EXPECT_EQ(shorted.sample(0).u_a_v, 0.0);
  EXPECT_GT(std::abs(shorted.sample(0).true_i_a_a), 0.1) << "no diode takes this current away at once";
  run(shorted, "short circuit");

  Bench locked = running_bench();
  ASSERT_EQ(submit(locked, fault_of("blocked_rotor", 1.0)), Refused::kNot);
  run(locked, "locked rotor");
  EXPECT_EQ(locked.sample(0).speed_rad_s, 0.0);

  Bench heavy = running_bench();
  ASSERT_EQ(submit(heavy, write_of(servo_axis(), "mechanics.inertia_kgm2", 10.0 * kServoInertia_kgm2)),
            Refused::kNot);
  run(heavy, "ten times the inertia");

  Bench powerless = running_bench();
  ASSERT_EQ(submit(powerless, fault_of("bus_sag", 1.0)), Refused::kNot);
  run(powerless, "no DC link");
  EXPECT_LT(std::abs(powerless.sample(0).true_i_a_a), 0.1);
}

}  // namespace
}  // namespace drivebench::brutal_plant_test
