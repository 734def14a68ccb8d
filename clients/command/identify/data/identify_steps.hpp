#pragma once

#include <string>

#include "clients/command/identify/data/identify_data.hpp"
#include "clients/command/identify/data/identify_options.hpp"
#include "clients/command/identify/data/identify_server.hpp"
#include "clients/identification/data/settings.hpp"
#include "clients/identification/motors/motors.hpp"
#include "clients/identification/named_experiments.hpp"

/// The steps of an identification, for `drivebench identify` and its suggestion.
namespace drivebench::command {

/// The row of --motor; throws UsageError for a name that is missing or not known.
const identification::MotorName& chosen_motor(const std::string& name);

/// The file and bench of a named experiment, or of the file of this name if `named` is null.
WantedExperiment wanted_experiment(const identification::MotorName& motor,
                                   const identification::NamedExperiment* named, const std::string& choice);

/// Applies the options of the command line, which override the settings of the experiment.
void apply_options(const IdentifyOptions& options, identification::Settings& settings);

/// What bench or recording and experiment say, overridden by the command line; the shaft's filter from the
/// data unless somebody has set it.
identification::Settings settings_for(const IdentifyOptions& options, const identification::MotorName& motor,
                                      const identification::NamedExperiment* named, const MeasuredMotor& m);

/// Puts the truth of the bench beside the estimates, if it is known.
void compare(const MeasuredMotor& m, const identification::Settings& settings,
             identification::Result& result);

}  // namespace drivebench::command
