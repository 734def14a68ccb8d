#pragma once

#include <limits>
#include <string>

#include "clients/command/identify/data/identify_data.hpp"
#include "clients/command/identify/data/identify_options.hpp"
#include "clients/command/identify/data/identify_server.hpp"
#include "clients/command/identify/suggest/suggest_design.hpp"
#include "clients/identification/data/result.hpp"
#include "clients/identification/motors/motors.hpp"
#include "clients/identification/named_experiments.hpp"

namespace drivebench::command {

/// What an experiment on the bench would tell of its motor.
struct ExperimentForecast {
  std::string name{};
  std::string problem{};  ///< why it could not be run or used; empty: the rest is there
  identification::Result result{};
  /// The largest half interval of a parameter, over its value, and whose it is; parameters that the bench has
  /// as zero do not count. Infinite: no motor near the equations' follows the record.
  double worst = std::numeric_limits<double>::infinity();
  std::string worst_name{};
  double current_a = 0.0;  ///< the largest of a phase
  double voltage_v = 0.0;
  double speed_rad_s = 0.0;
  double limit_used = 0.0;  ///< the largest share of a limit; above 1 it is exceeded
};

/// Whether an estimate counts: a parameter of the motor, other than the K4 to K17 of a regression, that the
/// bench knows and does not have as zero.
bool counts(const identification::Estimate& estimate) noexcept;

/// Puts the largest share of a limit into the forecast.
void use_limits(const ExperimentLimits& limits, ExperimentForecast& forecast);

/// Experiments on a server of our own, and what they tell.
class Forecasts {
 public:
  Forecasts(const IdentifyOptions& options, const identification::MotorName& motor, const std::string& bench);

  /// What the bench says of its axis and drive; adds signals to the experiment, and settings that make the
  /// voltages at the terminals those of the commands. Throws UsageError if the bench has a motor of another
  /// kind.
  MeasuredMotor prepare(WantedExperiment& experiment) const;

  /// The largest current, voltage and speed of an experiment, without an identification; one that cannot be
  /// run says why.
  ExperimentForecast measured(WantedExperiment wanted) const;

  /// Runs an experiment; one that cannot be run or used says why. `named` is null for a file of the user.
  /// Throws std::runtime_error if the server is lost or the user interrupts.
  ExperimentForecast run(std::string name, WantedExperiment wanted,
                         const identification::NamedExperiment* named) const;

 private:
  MeasuredMotor take(WantedExperiment wanted, ExperimentForecast& forecast) const;

  IdentifyOptions options_;
  const identification::MotorName& motor_;
  OwnBench bench_;
};

}  // namespace drivebench::command
