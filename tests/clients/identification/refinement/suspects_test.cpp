#include "clients/identification/refinement/suspects.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "clients/identification/identify.hpp"
#include "tests/clients/identification/monte_carlo/random_motors.hpp"

namespace drivebench::identification::suspects_test {
namespace {

constexpr Eigen::Index kRows = 1280;
constexpr int kSuspects = 15;

/// Noise of variance 1 that keeps `memory` of itself from row to row.
Eigen::VectorXd noisy(std::mt19937_64& engine, double memory) {
  std::normal_distribution<double> white;
  Eigen::VectorXd noise(kRows);
  double state = white(engine);
  for (double& each : noise) {
    each = state;
    state = memory * state + std::sqrt(1.0 - memory * memory) * white(engine);
  }
  return noise;
}

/// What residuals that one mean was fitted to say of suspects with these derivatives, in `each` of them.
std::optional<Suspicion> asked(const Eigen::VectorXd& residual, const Eigen::MatrixXd& directions,
                               std::size_t each = 1) {
  Fit fit;
  fit.residual = residual.array() - residual.mean();
  fit.jacobian = Eigen::MatrixXd::Ones(kRows, 1);
  fit.covariance = Eigen::MatrixXd::Constant(1, 1, 1.0 / kRows);
  const std::vector<SensorErrors> errors(each);
  const std::vector<Suspect> suspects(
      static_cast<std::size_t>(directions.cols()) / each,
      {.what = "an error of {}", .remedy = "", .errors = errors, .size = 1.0});
  return strongest_suspicion(fit, {{.name = "mean"}}, suspects, directions);
}

/// The records of noise, out of 2000, in which one of kSuspects is suspected: slow waves about a large
/// constant, each of which would move the mean by many of its intervals.
int false_alarms(double memory) {
  constexpr int kRecords = 2000;
  Eigen::MatrixXd waves(kRows, kSuspects);
  for (Eigen::Index k = 0; k < kRows; ++k) {
    for (int wave = 0; wave < kSuspects; ++wave)
      waves(k, wave) = 100.0 + std::cos(2.0 * std::numbers::pi * (wave + 1) * static_cast<double>(k) / kRows);
  }
  std::mt19937_64 engine(18);
  int alarms = 0;
  for (int record = 0; record < kRecords; ++record)
    alarms += asked(noisy(engine, memory), waves) ? 1 : 0;
  return alarms;
}

// The level is one record in 1,000 for all suspects together; the bound behind it is some 6 times too high
// for normal scores, so that white noise raises 0.3 alarms. Catches: a level that does not count the suspects
// (6 alarms).
TEST(Suspects, WhiteNoiseIsHardlySuspected) {
  EXPECT_LE(false_alarms(0.0), 1);
}

// Noise with a memory of a half scatters three times as much along slow waves. A hundredth of the records is
// what a user notices. Catches: a score that takes every residual for white (300 alarms).
TEST(Suspects, NoiseWithAMemoryIsHardlySuspected) {
  EXPECT_LE(false_alarms(0.5), 20);
}

// An error of 30 standard deviations that a 64th of the record shows. Catches: a variance of the score with
// the error's own scatter in it, under which it stands out by one.
TEST(Suspects, AnErrorInOnePartOfTheRecordIsSeen) {
  Eigen::MatrixXd direction = Eigen::MatrixXd::Zero(kRows, 1);
  direction.topRows(kRows / 64).setConstant(10.0);
  std::mt19937_64 engine(18);
  const Eigen::VectorXd residual = noisy(engine, 0.0) - 0.7 * direction.col(0);
  const std::optional<Suspicion> found = asked(residual, direction);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->deviations, 31.0, 3.0);
  EXPECT_EQ(found->moved, "mean");
  EXPECT_NEAR(std::stod(found->what.substr(12)), 0.7, 0.07) << found->what;
}

// An error that turns with the shaft, at 45 degrees: its sine and its cosine show 3.5 standard deviations
// each and move the mean by 0.8 of its interval, both together 5 and 1.6 (one must show 3.7, two 3.9).
// Catches: two halves of one error that are asked apart, each of which looks harmless.
TEST(Suspects, BothDirectionsOfAnErrorAreAskedTogether) {
  constexpr double kMean = 0.317;
  Eigen::MatrixXd turning(kRows, 2);
  for (Eigen::Index k = 0; k < kRows; ++k) {
    const double angle = 2.0 * std::numbers::pi * 20.0 * static_cast<double>(k) / kRows;
    turning(k, 0) = kMean + std::sin(angle);
    turning(k, 1) = kMean + std::cos(angle);
  }
  const double amount = 3.5 / std::sqrt(kRows / 2.0);
  const Eigen::VectorXd residual = -amount * (turning.col(0) + turning.col(1));
  EXPECT_FALSE(asked(residual, turning));
  const std::optional<Suspicion> found = asked(residual, turning, 2);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->deviations, 3.5 * std::numbers::sqrt2, 1e-6);
  EXPECT_NEAR(std::stod(found->what.substr(12)), amount * std::numbers::sqrt2, 1e-3 * amount) << found->what;
}

/// An error of the sensors in the record of a motor of the table, and what the verdict calls it.
struct Disturbed {
  const char* motors;
  int number;
  std::function<void(MeasuredData&)> disturb;
  const char* told;
};

Series& column_of(MeasuredData& data, const std::string& name) {
  for (Column& column : data.columns) {
    if (column.name == name) return column.values;
  }
  throw IdentificationError("no column " + name);
}

/// y follows x by this part of its distance with each sample, as a filter of first order in a sensor does.
void filter(Series& x, double part) {
  double y = x[0];
  for (double& value : x)
    value = y += part * (value - y);
}

void multiply(Series& x, double gain) {
  for (double& value : x)
    value *= gain;
}

void delay_encoder(MeasuredData& data, std::size_t samples) {
  Series& count = column_of(data, "encoder_count");
  const Series before = count;
  for (std::size_t k = samples; k < count.size(); ++k)
    count[k] = before[k - samples];
}

/// The encoder of 2000 counts sits off its centre: its angle strays by this much once in a turn.
void put_off_centre(MeasuredData& data, double amplitude_rad, double phase_rad) {
  constexpr double kPerRad = 2000.0 / (2.0 * std::numbers::pi);
  for (double& count : column_of(data, "encoder_count"))
    count = std::round(count + kPerRad * amplitude_rad * std::sin(count / kPerRad + phase_rad));
}

const std::vector<Disturbed>& disturbed() {
  static const std::vector<Disturbed> all = {
      {"DC motors", 75, [](MeasuredData& d) { filter(column_of(d, "u_a_v"), 0.66); }, "s late"},
      {"PM synchronous motors", 76,
       [](MeasuredData& d) {
         for (const char* name : {"u_a_v", "u_b_v"})
           filter(column_of(d, name), 0.61);
       },
       "s late"},
      {"DC motors", 116, [](MeasuredData& d) { put_off_centre(d, 0.0096, 2.55); }, "off its centre"},
      {"DC motors", 168, [](MeasuredData& d) { put_off_centre(d, 0.0157, 4.27); }, "off its centre"},
      {"Brushless DC motors", 187, [](MeasuredData& d) { delay_encoder(d, 1); }, "an encoder that is"},
      {"Brushless DC motors", 83, [](MeasuredData& d) { multiply(column_of(d, "i_b_a"), 1.017); },
       "a gain of i_b_a"},
      {"Induction motors", 134, [](MeasuredData& d) { multiply(column_of(d, "i_b_a"), 1.008); },
       "a gain of i_b_a"}};
  return all;
}

const MotorDraw& draw_named(const std::string& name) {
  for (const MotorDraw& draw : motor_draws()) {
    if (draw.name == name) return draw;
  }
  throw IdentificationError("no motors " + name);
}

// Errors of sensors that currents, voltages and shaft take without more noise than a record may have. Each of
// these motors was certified with a parameter 6 to 250 standard deviations off. Catches: a fit that is asked
// nothing about its sensors, a suspect whose derivative has the wrong sign or instant.
TEST(Suspects, AMotorWhoseSensorsErrIsRefusedWithTheirError) {
  for (const Disturbed& each : disturbed()) {
    SCOPED_TRACE(std::string(each.motors) + " " + each.told);
    Recorded run = record_motor(draw_named(each.motors), each.number, 1);
    each.disturb(run.data);
    const Result r = identify(run.data, run.how);
    EXPECT_FALSE(r.excitation.sufficient) << to_markdown(r);
    EXPECT_NE(r.excitation.verdict.find(each.told), std::string::npos) << r.excitation.verdict;
  }
}

// Converters of 12 bits, their noise, and the counts of the encoder are no error. Catches: a gain whose
// derivative moves the noise of a current with it, which takes honest gains for too small by 3 to 8 standard
// deviations; a threshold that noise passes.
TEST(Suspects, AMotorWithTheNoiseOfItsSensorsIsCertified) {
  for (const MotorDraw& draw : motor_draws()) {
    for (const int number : {1, 2, 3}) {
      const Recorded run = record_motor(draw, number, 1);
      const Result r = identify(run.data, run.how);
      EXPECT_TRUE(r.excitation.sufficient) << draw.name << " " << number << "\n" << r.excitation.verdict;
    }
  }
}

}  // namespace
}  // namespace drivebench::identification::suspects_test
