#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "clients/identification/identify.hpp"
#include "clients/identification/motors/motor_models.hpp"
#include "clients/identification/refinement/rounds.hpp"
#include "tests/clients/identification/monte_carlo/random_motors.hpp"

namespace drivebench::identification::predictor_test {
namespace {

/// The column of each unknown by differences of whole runs, less that of the variational equations, over its
/// length.
template <class Model>
std::vector<double> errors_of_derivatives(const MotorDraw& draw) {
  constexpr double kDifference = 1e-4;
  Recorded run = record_motor(draw, 1, 1);
  run.how.processing.to_s = run.how.processing.from_s + 0.1;
  run.how.sensors = {.current_offsets = true,
                     .voltage_offsets = true,
                     .zero = draw.kind == MotorKind::kPmSynchronous,
                     .gains = true};
  Result trial = identify_by_equations(run.data, run.how);
  const PredictorRecord record = record_of(run.data, run.how);
  std::vector<Unknown> unknowns = unknowns_of(run.how, trial, record.largest_speed, 0.1);
  add_sensors(run.how, record, trial, unknowns);
  Predictor<Model> predictor(record, Model(trial, run.how));
  predictor.linearise(Model(trial, run.how), first_noise(record, run.how));
  const MotorResiduals<Model> residuals(predictor, unknowns, trial, run.how);
  Eigen::VectorXd at = coordinates_of(unknowns, trial);
  Eigen::MatrixXd derivatives;
  EXPECT_TRUE(residuals.derivatives(at, derivatives));
  std::vector<double> errors;
  for (Eigen::Index k = 0; k < at.size(); ++k) {
    Eigen::VectorXd more;
    Eigen::VectorXd less;
    for (const double sign : {1.0, -1.0}) {
      Eigen::VectorXd there = at;
      there(k) += sign * kDifference;
      EXPECT_TRUE(residuals.values(there, sign > 0.0 ? more : less));
    }
    const Eigen::VectorXd column = (more - less) / (2.0 * kDifference);
    errors.push_back((derivatives.col(k) - column).norm() / column.norm());
  }
  return errors;
}

void expect_small(const std::vector<double>& errors) {
  constexpr double kMost = 0.01;  // a step is a fifth of the fastest time constant at most, and its middle
                                  // stands for all of it: the square of that over 24, and some for friction
  for (std::size_t k = 0; k < errors.size(); ++k)
    EXPECT_LT(errors[k], kMost) << "unknown " << k;
}

// Catches: samples that are counted from the begin of the record and not of its range, a period that stays
// that of the record, a first count that ends four times as late.
TEST(Predictor, AThinnedRecordHasEveryFourthSample) {
  const Recorded run = record_motor(motor_draws()[1], 1, 1);
  PredictorRecord record = record_of(run.data, run.how);
  record.still = 5;
  const PredictorRecord thin = thinned(record, 4);
  ASSERT_GT(record.range.first, 0U);
  EXPECT_EQ(thin.range.count(), (record.range.count() + 3) / 4);
  EXPECT_DOUBLE_EQ(thin.period_s, 4.0 * record.period_s);
  EXPECT_EQ(thin.still, 2U);
  EXPECT_EQ(thin.angle[thin.range.first + 10], record.angle[record.range.first + 40]);
  EXPECT_EQ(thin.currents[0][thin.range.first + 10], record.currents[0][record.range.first + 40]);
  EXPECT_EQ(thin.voltages.at(thin.range.first + 10, 0.0), record.voltages.at(record.range.first + 40, 0.0));
}

// Of every parameter of every kind of motor, and of every error of its sensors. Catches: a column that
// forgets what the innovations do to the state, an offset or a gain of the voltages with the other sign, a
// frame that does not turn with the encoder's zero, a first state that moves with nothing.
TEST(Predictor, ItsDerivativesAreThoseOfItsInnovations) {
  expect_small(errors_of_derivatives<InductionModel>(motor_draws()[1]));
  expect_small(errors_of_derivatives<PmModel>(motor_draws()[2]));
  expect_small(errors_of_derivatives<BldcModel>(motor_draws()[3]));
}

}  // namespace
}  // namespace drivebench::identification::predictor_test
