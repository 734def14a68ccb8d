#include "clients/identification/motors/dc_motor.hpp"
#include "clients/identification/identify.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tests/clients/identification/bench_data.hpp"

namespace drivebench::identification::dc_motor_test {
namespace {

constexpr double kPi = std::numbers::pi;

void expect_percent(double value, double truth, double percent) {
  EXPECT_NEAR(value, truth, 0.01 * percent * std::abs(truth));
}

/// DC-A under a current loop of 100 kHz (20 V/A, alpha 1000) that follows `current_a` from `from_s` to 1 s
/// past it, sampled at 1 kHz with its encoder of 2000 counts.
template <class Current>
BookBench run_dc(Current current_a, double from_s, Recorder& record) {
  BenchConfig config = bench_config("dc-a-servo");
  set_rate(config, 10'000, 1);
  BookBench run(config);
  run.control_until(from_s, [&](const Sample&) {
    return PhaseCommand{.gates = Gates::kCurrent, .setpoint = {.a = current_a(run.now_s())}};
  });
  run.control_until(from_s + 1.0, [&](const Sample& s) {
    record(s);
    return PhaseCommand{.gates = Gates::kCurrent, .setpoint = {.a = current_a(run.now_s())}};
  });
  return run;
}

/// Problem 2.28: 10 Hz, then 20 Hz, 2.5 A.
double sines(double t) {
  return 2.5 * std::sin(2.0 * kPi * t / (t < 0.5 ? 0.1 : 0.05));
}

/// The voltage of the last of 100 ticks in a millisecond is that of the sample.
Settings dc_experiment() {
  Settings e{.kind = MotorKind::kDc, .counts_per_revolution = 2000.0};
  e.processing = usual_processing(MotorKind::kDc, 1e-3);
  e.processing.voltage_shift = 0.0;
  return e;
}

// AC-15: R, K_T 0.5 %, L 1 %, J 2 %, f 10 %, error index 0.001 to 0.005. Catches: differences late by half a
// sample, currents without the filter of the voltage, a row with a sign wrong.
TEST(DcMotor, SinesOfCurrentIdentifyAllFiveParameters) {
  Recorder record({"i_a_a", "u_a_v", "encoder_count"}, 1e-5, 100);
  run_dc(sines, 0.0, record);
  const Result r = identify_by_equations(record.data(), dc_experiment());
  expect_percent(r.at("L"), 2e-3, 1.0);
  expect_percent(r.at("R"), 2.0, 0.5);
  expect_percent(r.at("K_T"), 0.07, 0.5);
  expect_percent(r.at("J"), 6e-5, 2.0);
  expect_percent(r.at("f"), 4e-4, 10.0);
  EXPECT_GT(r.error_index, 0.001);
  EXPECT_LT(r.error_index, 0.005);
  EXPECT_TRUE(r.excitation.sufficient) << r.excitation.verdict;
}

// AC-15, negative: backward differences beside unshifted signals lose friction, about -73 %. Catches: an
// alignment that does nothing.
TEST(DcMotor, BackwardDifferencesLoseTheFriction) {
  Recorder record({"i_a_a", "u_a_v", "encoder_count"}, 1e-5, 100);
  run_dc(sines, 0.0, record);
  Settings e = dc_experiment();
  e.processing.backward_differences = true;
  const double error = identify_by_equations(record.data(), e).at("f") / 4e-4 - 1.0;
  EXPECT_LT(error, -0.5);
  EXPECT_GT(error, -0.95);
}

// AC-15 with exact derivatives: 1e-6 and better. i = sin(at) + sin(bt), w from the equation of motion, v from
// that of the circuit. Catches: an equation that is not the motor's.
TEST(DcMotor, ExactDerivativesGiveExactParameters) {
  constexpr double kL = 2e-3, kR = 2.0, kT = 0.07, kJ = 6e-5, kF = 4e-4;
  Regression fit({"L", "R", "K_T", "J", "f"});
  for (int k = 0; k < 1000; ++k) {
    double i = 0.0, di = 0.0, w = 0.0, dw = 0.0;
    for (const double a : {2.0 * kPi * 10.0, 2.0 * kPi * 20.0}) {
      const double t = 1e-3 * k;
      const double size = kT / (kF * kF + kJ * kJ * a * a);  // w = size (f sin - J a cos)
      i += std::sin(a * t);
      di += a * std::cos(a * t);
      w += size * (kF * std::sin(a * t) - kJ * a * std::cos(a * t));
      dw += size * a * (kF * std::cos(a * t) + kJ * a * std::sin(a * t));
    }
    fit.add(std::array{di, i, w, 0.0, 0.0}, kL * di + kR * i + kT * w);
    fit.add(std::array{0.0, 0.0, -i, dw, w}, 0.0);
  }
  const LeastSquares found = fit.solve();
  const double truth[] = {kL, kR, kT, kJ, kF};
  for (std::size_t n = 0; n < 5; ++n)
    EXPECT_NEAR(found.estimate[n], truth[n], 1e-6 * truth[n]);
  EXPECT_LT(found.error_index, 1e-7);
}

// AC-16: a constant current, after the transient of J/f = 0.15 s. 437.5 rad/s and 35.625 V to 0.1 %,
// condition of R_W beyond 1e10; all five parameters are named: R and K_T as well as K_T and f stand beside
// constants, L and J beside nothing. Catches: numbers printed for what the data do not hold.
TEST(DcMotor, AConstantCurrentIdentifiesNothing) {
  Recorder record({"i_a_a", "u_a_v", "encoder_count"}, 1e-5, 100);
  const BookBench run = run_dc([](double) { return 2.5; }, 3.0, record);
  EXPECT_NEAR(run.sample().speed_rad_s, 437.5, 0.44);
  EXPECT_NEAR(run.sample().u_a_v, 35.625, 0.036);
  const Result r = identify_by_equations(record.data(), dc_experiment());
  EXPECT_FALSE(r.excitation.sufficient) << to_markdown(r);
  for (const char* name : {"R", "K_T"})
    EXPECT_EQ(std::count(r.excitation.unseen.begin(), r.excitation.unseen.end(), name), 1)
        << r.excitation.verdict;
  EXPECT_GT(r.normal_condition, 1e10);
  EXPECT_THROW(to_motor_toml(r, {.name = "x"}), IdentificationError);
}

// Catches: a record without samples in its window that gives a motor all the same; columns of different
// length.
TEST(DcMotor, UnusableDataAreRefused) {
  MeasuredData data{.period_s = 1e-3,
                    .columns = {{"i_a_a", "A", Series(80, 0.0)}, {"u_a_v", "V", Series(80, 0.0)}}};
  EXPECT_THROW(identify_by_equations(data, dc_experiment()), IdentificationError);  // 40 samples are left
  data.columns[0].values.resize(200);
  data.columns[1].values.resize(200);
  EXPECT_THROW(identify_by_equations(data, dc_experiment()), IdentificationError);  // no encoder
  data.columns.push_back({"encoder_count", "counts", Series(199, 0.0)});
  EXPECT_THROW(identify_by_equations(data, dc_experiment()), IdentificationError);  // one count is missing
  data.columns[2].values.resize(200);
  const Result r = identify_by_equations(data, dc_experiment());
  EXPECT_EQ(r.excitation.unseen.size(), 5U);
  data.period_s = 0.0;
  EXPECT_THROW(identify_by_equations(data, dc_experiment()), IdentificationError);
}

}  // namespace
}  // namespace drivebench::identification::dc_motor_test
