#pragma once

#include "clients/command/identify/data/identify_options.hpp"
#include "clients/identification/motors/motors.hpp"
#include "clients/identification/named_experiments.hpp"

namespace drivebench::command {

/// The tests at the terminals of an induction motor, alone or all three in turn, from experiments or from
/// files.
int run_terminal_tests(const IdentifyOptions& options, const identification::MotorName& motor,
                       const identification::NamedExperiment& chosen);

}  // namespace drivebench::command
