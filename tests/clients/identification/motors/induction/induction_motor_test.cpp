#include "clients/identification/motors/induction/induction_motor.hpp"
#include "clients/identification/identify.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <random>

#include "clients/identification/motors/induction/induction_regressor.hpp"
#include "tests/clients/identification/bench_data.hpp"

namespace drivebench::identification::induction_motor_test {
namespace {

constexpr double kSigma = 1.0 - 0.64 * 0.64 / (0.67 * 0.67);

/// Within so many percent.
void expect_percent(double value, double truth, double percent) {
  EXPECT_NEAR(value, truth, 0.01 * percent * std::abs(truth));
}

/// The start of 8.5.5 from the line, 0 to 0.21 s; `ideal`: true currents and angle.
MeasuredData start_data(std::int64_t period_ns, bool ideal) {
  BenchConfig config = bench_config("im-8-5-5");
  set_rate(config, period_ns, static_cast<int>(period_ns / 12'500));
  BookBench run(config);
  Recorder record = line_recorder(run.period_s(), ideal);
  run.run_until(0.21, std::ref(record));
  return record.data();
}

Settings ideal_experiment() {
  Settings e{.kind = MotorKind::kInduction, .pole_pairs = 2, .load = LoadModel::kConstant};
  e.processing = {.voltage_shift = 0.0, .from_s = 0.005, .to_s = 0.2};
  return e;
}

Settings sensor_experiment(double period_s) {
  Settings e = ideal_experiment();
  e.counts_per_revolution = 2048;
  e.processing = usual_processing(MotorKind::kInduction, period_s);
  e.processing.from_s = 0.005;
  e.processing.to_s = 0.2;
  return e;
}

// Case 22: the equations hold at 200 random states with the model's own derivatives, to 1e-10 of the largest
// term. Catches: any of the 15 columns with a sign, a factor n_p or a signal wrong.
TEST(InductionMotor, EveryColumnOfTheRegressorFitsTheModel) {
  using Complex = std::complex<double>;
  constexpr Complex j(0.0, 1.0);
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> random(-1.0, 1.0);
  const auto pair = [&] { return Complex(random(engine), random(engine)); };
  for (int trial = 0; trial < 200; ++trial) {
    const double t_r = 0.1 + 0.05 * random(engine);
    const double l_s = 0.5 + 0.2 * random(engine);
    const double sigma = 0.2 + 0.1 * random(engine);
    const double r_s = 5.0 + 2.0 * random(engine);
    const double gamma = (r_s + (1.0 - sigma) * l_s / t_r) / (sigma * l_s);
    const double n = 1.0 + trial % 4;
    const double w = 150.0 * random(engine);
    const double dw = 2000.0 * random(engine);
    // phi = (M/L_R) psi in the rotor's frame: phi' = -phi/T_R + (1 - sigma) L_S i/T_R.
    const Complex i = 10.0 * pair();
    const Complex phi = pair();
    const Complex u = 300.0 * pair();
    const Complex du = 5e4 * pair();
    const Complex di =
        (1.0 / t_r - j * n * w) * phi / (sigma * l_s) - (gamma + j * n * w) * i + u / (sigma * l_s);
    const Complex dphi = -phi / t_r + (1.0 - sigma) * l_s / t_r * i;
    const Complex ddi = ((1.0 / t_r - j * n * w) * dphi - j * n * dw * phi + du) / (sigma * l_s) -
                        (gamma + j * n * w) * di - j * n * dw * i;
    const InductionEquations rows =
        induction_equations({i.real(), i.imag(), di.real(), di.imag(), ddi.real(), ddi.imag(), u.real(),
                             u.imag(), du.real(), du.imag(), w, dw},
                            n);
    const double bm = (1.0 - sigma) / sigma;
    for (const auto& [row, y] : {std::pair{rows.x_row, rows.x}, std::pair{rows.y_row, rows.y}}) {
      double sum = -y;
      double largest = std::abs(y);
      for (std::size_t k = 0; k < kInductionParameters; ++k) {
        const auto [factor, power] = kInductionMonomials[k];
        const double of = factor == InductionFactor::kK4    ? bm / (t_r * t_r)
                          : factor == InductionFactor::kK6  ? gamma / t_r
                          : factor == InductionFactor::kK14 ? 1.0 / (sigma * l_s * t_r)
                                                            : 1.0;
        const double term = row[k] * of * std::pow(t_r, power);
        sum += term;
        largest = std::max(largest, std::abs(term));
      }
      ASSERT_LT(std::abs(sum), 1e-10 * largest) << trial;
    }
  }
}

// Case 23: the table of 8.5.6, 0.2 % and the text's rounding. Catches: sigma for 1 - sigma, T_R in the wrong
// place, J = K_16 n_p.
TEST(InductionMotor, TheTextsTableConvertsToItsParameters) {
  const InductionParameters p = induction_parameters(519.7, 1848.3, 0.1311, 259.5);
  expect_percent(p.stator_resistance_ohm, 5.12, 0.2);
  expect_percent(p.stator_inductance_h, 0.2919, 0.2);
  expect_percent(p.leakage_factor, 0.1007, 0.2);
  expect_percent(p.mutual_inductance_h, 0.2768, 0.2);
  expect_percent(p.rotor_resistance_ohm, 2.23, 0.2);
  EXPECT_NEAR(2.0 / 952.38, 0.0021, 5e-6);
}

// Case 19: 4 kHz, true signals, central differences: 0.1 % of the truth, one minimum with positive parameters
// and the proof that there is no other. Catches: a wrong derivative, a search that stops at the first
// minimum.
TEST(InductionMotor, IdealDataGiveTheTruthAndOneMinimum) {
  MeasuredData data = start_data(250'000, true);
  put_line_voltages(data, 381.059, 50.0, 1);
  Result r = identify_by_equations(data, ideal_experiment());
  expect_percent(r.at("K4"), 1717.2, 0.1);
  expect_percent(r.at("K6"), 3839.8, 0.1);
  expect_percent(r.at("K8"), 0.0779, 0.1);
  expect_percent(r.at("K14"), 218.83, 0.1);
  expect_percent(r.at("R_S"), 9.7, 0.1);
  expect_percent(r.at("sigma"), kSigma, 0.1);
  expect_percent(r.at("K16"), 181.82, 1.0);
  expect_percent(r.at("tau_L"), 3.7, 1.0);
  EXPECT_TRUE(r.excitation.sufficient) << r.excitation.verdict;
  EXPECT_EQ(r.notes.at(0), "1 of 2 minima over T_R > 0 belong to a motor; there are no others");
}

// Case 20: encoder of 2048 counts, 12-bit currents, 200 and 100 Hz. The tolerances are the case's about the
// truth; the reference's own K_17, 314, is 7 % low as its torque did not pass the filter of the speed: 10 %
// holds both. The index holds the true error. Catches: a filter with phase, different filters in one
// equation.
TEST(InductionMotor, SensorsAndFiltersKeepTheParameters) {
  const Result r = identify_by_equations(start_data(250'000, false), sensor_experiment(2.5e-4));
  expect_percent(r.at("R_S"), 9.7, 1.5);
  expect_percent(r.at("T_R"), 0.67 / 8.6, 1.5);
  expect_percent(r.at("L_S"), 0.67, 1.5);
  expect_percent(r.at("sigma"), kSigma, 1.5);
  expect_percent(r.at("K4"), 1717.2, 3.0);
  expect_percent(r.at("K14"), 218.83, 3.0);
  expect_percent(r.at("K16"), 177.7, 4.0);
  expect_percent(r.at("K17"), 314.0, 10.0);
  for (const char* name : {"R_S", "T_R", "L_S", "sigma"}) {
    const double truth = std::string(name) == "R_S"   ? 9.7
                         : std::string(name) == "T_R" ? 0.67 / 8.6
                         : std::string(name) == "L_S" ? 0.67
                                                      : kSigma;
    EXPECT_LT(std::abs(r.at(name) - truth), r.find(name)->index) << name;
  }
}

// Case 21: backward differences bias R_S by -3 % at 4 kHz and by a fifth of it at 20 kHz; 1 % and 0.5 %.
// Catches: a "backward" that is central after all, so that the difference does not show.
TEST(InductionMotor, BackwardDifferencesBiasTheResistance) {
  Settings e = ideal_experiment();
  e.processing.backward_differences = true;
  MeasuredData data = start_data(250'000, true);
  put_line_voltages(data, 381.059, 50.0, 1);
  const Result slow = identify_by_equations(data, e);
  expect_percent(slow.at("R_S"), 9.41, 1.0);
  expect_percent(slow.at("K4"), 1759.0, 1.0);
  MeasuredData often = start_data(50'000, true);
  put_line_voltages(often, 381.059, 50.0, 1);
  expect_percent(identify_by_equations(often, e).at("R_S"), 9.64, 0.5);
}

// Half a sample between voltages and currents is enough to lose 5 % and more of R_S at 4 kHz. Catches: a
// shift that is not applied, a default that does not suit the source.
TEST(InductionMotor, VoltagesHalfASampleOffBiasTheResistance) {
  const MeasuredData data = start_data(250'000, true);
  Settings e = ideal_experiment();
  expect_percent(identify_by_equations(data, e).at("R_S"), 9.7, 0.1);
  e.processing.voltage_shift = 0.5;
  EXPECT_LT(identify_by_equations(data, e).at("R_S"), 0.95 * 9.7);
}

// The start of 8.5.6 without load: 4096 counts, viscous friction. The reference's own run: R_S 5.10, T_R
// 0.1297; 2 % of the truth for the electrical ones. Catches: the other load model, one motor's filters that
// another cannot stand.
TEST(InductionMotor, TheLineStartOfTheExperiment) {
  BookBench run("im-8-5-6");
  Recorder record = line_recorder(run.period_s(), false);
  run.run_until(0.3, std::ref(record));
  Settings e = sensor_experiment(run.period_s());
  e.counts_per_revolution = 4096;
  e.load = LoadModel::kViscous;
  const Result r = identify_by_equations(record.data(), e);
  expect_percent(r.at("R_S"), 5.12, 2.0);
  expect_percent(r.at("T_R"), 0.1311, 2.0);
  expect_percent(r.at("L_S"), 0.2919, 2.0);
  expect_percent(r.at("sigma"), 0.1007, 2.0);
  expect_percent(r.at("J"), 0.0021, 4.0);
}

// A motor that runs without load carries no current in its rotor: T_R must not come out as a number. Catches:
// a minimum of noise that is printed as a parameter.
TEST(InductionMotor, WithoutLoadNothingIsIdentified) {
  BenchConfig config = bench_config("im-8-5-5");
  config.axes[0].events = {{.tick = 0, .action = LoadChange{.load_nm = 0.0, .ramp_ticks = 0}}};
  BookBench run(config);
  run.run_until(2.0);
  Recorder record = line_recorder(run.period_s(), false);
  run.run_until(2.25, std::ref(record));
  const Result r = identify_by_equations(record.data(), sensor_experiment(run.period_s()));
  EXPECT_FALSE(r.excitation.sufficient) << to_markdown(r);
  EXPECT_TRUE(std::count(r.excitation.unseen.begin(), r.excitation.unseen.end(), "T_R") == 1)
      << r.excitation.verdict;
}

// Noise of 0.073 A on currents of 20 A: the second derivative makes so much of it that R_S is known to half
// its value only. A minimum with the parameters of a motor is there, the truth lies within its indices, and
// the verdict names R_S. Catches: a verdict that does not look at the indices.
TEST(InductionMotor, TheVerdictNamesAParameterHiddenByNoise) {
  MeasuredData data = start_data(250'000, true);
  std::mt19937 engine(2);
  std::normal_distribution<double> noise(0.0, 0.073);
  for (std::size_t column = 0; column < 3; ++column) {
    for (double& x : data.columns[column].values)
      x += noise(engine);
  }
  const Result r = identify_by_equations(data, sensor_experiment(2.5e-4));
  ASSERT_NE(r.find("K8"), nullptr);
  EXPECT_LT(std::abs(r.at("R_S") - 9.7), r.find("R_S")->index);
  EXPECT_LT(std::abs(r.at("T_R") - 0.67 / 8.6), 1.5 * r.find("T_R")->index);
  EXPECT_FALSE(r.excitation.sufficient);
  EXPECT_EQ(std::count(r.excitation.unseen.begin(), r.excitation.unseen.end(), "R_S"), 1) << to_markdown(r);
}

}  // namespace
}  // namespace drivebench::identification::induction_motor_test
