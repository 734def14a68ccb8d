#include "clients/identification/motors/classical_tests.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/clients/identification/bench_data.hpp"

namespace drivebench::identification {
namespace {

/// The power analyser on im-b at 208 V, held or turned at the speed of the field.
MeterReading reading(bool held) {
  BenchConfig config = bench_config("im-b");
  MechanicsParameters& mechanics = config.setup.axes[0].parameters.mechanics;
  config.setup.substeps = 10;
  mechanics.motion = held ? ShaftMotion::kLocked : ShaftMotion::kImposed;
  mechanics.imposed_speed_rad_s = 2.0 * std::numbers::pi * 60.0 / 3.0;
  BookBench run(config);
  run.run_until(3.0);
  const Sample& s = run.sample();
  return {.voltage_v = s.meter_u_rms_v,
          .current_a = s.meter_i_rms_a,
          .active_w = s.meter_p_w,
          .reactive_var = s.meter_q_var};
}

// AC-23, 0.3 percentage points: L_S right, R_R 15 % and sigma 3.5 % low, M 0.3 % high. Catches: power per
// phase for power of all, w for 2 w of the leakage.
TEST(ClassicalTests, GiveTheErrorsOfTheBook) {
  Result r = classical_induction_tests(1.85, reading(false), reading(true), 60.0);
  r.compare({{"L_S", 0.244}, {"R_R", 2.1}, {"M", 0.225}, {"sigma", 1.0 - 0.225 * 0.225 / (0.244 * 0.244)}});
  const auto error = [&](const char* name) { return 100.0 * (r.at(name) / *r.find(name)->truth - 1.0); };
  EXPECT_NEAR(error("L_S"), 0.0, 0.3);
  EXPECT_NEAR(error("R_R"), -15.0, 0.3);
  EXPECT_NEAR(error("M"), 0.3, 0.3);
  EXPECT_NEAR(error("sigma"), -3.5, 0.3);
}

// Catches: a resistance of two phases taken for that of one; division by no current.
TEST(ClassicalTests, ResistanceFromTwoPhasesInSeries) {
  EXPECT_DOUBLE_EQ(dc_resistance_ohm(7.4, 2.0), 1.85);
  EXPECT_THROW(dc_resistance_ohm(7.4, 0.0), IdentificationError);
  EXPECT_THROW(no_load_inductance_h({}, 60.0), IdentificationError);
}

// DC-A held at standstill, 2 V at 5 ms, 10 kHz: R to 0.1 %, L to 1 % (what central differences lose of a time
// constant of ten samples). Catches: a voltage half a period off, L/R in the place of L.
TEST(ClassicalTests, AStepAtStandstillGivesResistanceAndInductance) {
  BenchConfig config = bench_config("dc-a-voltage");
  config.setup.axes[0].parameters.mechanics.motion = ShaftMotion::kLocked;
  BookBench run(config);
  Recorder record({"i_a_a", "u_a_v"}, run.period_s());
  run.control_until(0.03, [&](const Sample& s) {
    record(s);
    return PhaseCommand{.gates = Gates::kVoltage, .setpoint = {.a = run.now_s() < 0.00495 ? 0.0 : 2.0}};
  });
  const Result r = standstill_step(record.data(), "i_a_a", "u_a_v");
  EXPECT_NEAR(r.at("R"), 2.0, 2e-3);
  EXPECT_NEAR(r.at("L"), 2e-3, 2e-5);
  EXPECT_TRUE(r.excitation.sufficient);
}

}  // namespace
}  // namespace drivebench::identification
