#include "clients/identification/motors/classical_tests.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "tests/clients/identification/bench_data.hpp"

namespace drivebench::identification::classical_tests_test {
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
          .reactive_var = s.meter_q_var,
          .frequency_hz = 60.0};
}

constexpr double kSigma = 1.0 - 0.225 * 0.225 / (0.244 * 0.244);

// AC-23, 0.3 percentage points: L_S right, R_R 15 % and sigma 3.5 % low, M 0.3 % high. With the magnetising
// branch left in, the same readings give the motor to 0.02 %, which is what the meter's sums leave. Catches:
// power per phase for power of all, w for 2 w of the leakage, a branch that is solved with the wrong sign.
TEST(ClassicalTests, GiveTheErrorsOfTheBook) {
  const MeterReading no_load = reading(false);
  const MeterReading blocked = reading(true);
  const TestedMotor m = tested_motor(1.85, no_load, blocked);
  const auto error = [](double value, double truth) { return 100.0 * (value / truth - 1.0); };
  EXPECT_NEAR(error(m.stator_inductance_h, 0.244), 0.0, 0.3);
  EXPECT_NEAR(error(m.rotor_resistance_ohm, 2.1), -15.0, 0.3);
  EXPECT_NEAR(error(m.mutual_inductance_h, 0.225), 0.3, 0.3);
  EXPECT_NEAR(error(m.leakage_factor, kSigma), -3.5, 0.3);
  const auto exact = motor_with_branch(1.85, no_load, blocked);
  ASSERT_TRUE(exact);
  EXPECT_NEAR(error(exact->rotor_resistance_ohm, 2.1), 0.0, 0.02);
  EXPECT_NEAR(error(exact->mutual_inductance_h, 0.225), 0.0, 0.02);
  EXPECT_NEAR(error(exact->leakage_factor, kSigma), 0.0, 0.02);
  EXPECT_NEAR(error(exact->rotor_time_constant_s, 0.244 / 2.1), 0.0, 0.02);
}

// Readings of no motor are refused, and without voltage there is no impedance. Catches: division by no
// current, a resistance below zero that becomes a motor.
TEST(ClassicalTests, RefuseReadingsOfNoMotor) {
  const MeterReading none;
  EXPECT_THROW(dc_resistance_ohm(none), IdentificationError);
  EXPECT_THROW(no_load_inductance_h(none), IdentificationError);
  EXPECT_THROW(tested_motor(100.0, reading(false), reading(true)), IdentificationError);
  EXPECT_THROW(tested_motor(1.85, reading(true), reading(false)), IdentificationError);
  EXPECT_DOUBLE_EQ(dc_resistance_ohm({.voltage_v = 7.4, .current_a = 4.0, .active_w = 88.8}), 1.85);
}

// A run without load whose slip is imposed: the power beside the copper gives that slip back, and
// the bias of L_S that it makes. Catches: the copper of one phase, a slip of the wrong branch of x/(1 + x^2).
TEST(ClassicalTests, LossesWithoutLoadAreASlip) {
  const double omega = 2.0 * std::numbers::pi * 60.0;
  for (const double slip_angle : {0.002, 0.1, 0.5}) {
    const std::complex<double> z =
        1.85 + std::complex<double>(0.0, omega * 0.244) *
                   (kSigma + (1.0 - kSigma) / std::complex<double>(1.0, slip_angle));
    TerminalReading no_load;
    no_load.meter = {.voltage_v = 2.0 * std::abs(z),
                     .current_a = 2.0,
                     .active_w = 12.0 * z.real(),
                     .reactive_var = 12.0 * z.imag(),
                     .frequency_hz = 60.0};
    const NoLoadLosses losses = no_load_losses(no_load, 1.85, 0.0, kSigma);
    EXPECT_NEAR(losses.power_w, 12.0 * (z.real() - 1.85), 1e-9);
    const double bias = z.imag() / omega / 0.244 - 1.0;
    EXPECT_NEAR(losses.inductance_bias, bias, 1e-9);
    EXPECT_NEAR(losses.slip_angle, slip_angle, 1e-9);
  }
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
}  // namespace drivebench::identification::classical_tests_test
