#pragma once

#include "clients/command/experiment/experiment_file.hpp"
#include "clients/command/identify/identify.hpp"
#include "clients/command/identify/identify_data.hpp"

namespace drivebench::command {

/// An experiment to run, and a bench to start if no server has one for it.
struct WantedExperiment {
  ExperimentFile file;
  std::string bench;         ///< the bench to start; empty: none
  std::string_view machine;  ///< kind that the axis must have
};

/// Runs the experiment on a server and fetches its data: on the server of the link if its bench has the axis,
/// else on a server that this call starts and ends. Throws UsageError if the bench does not fit,
/// std::runtime_error if the experiment does not complete.
MeasuredMotor measure(const IdentifyOptions& options, const WantedExperiment& wanted);

}  // namespace drivebench::command
