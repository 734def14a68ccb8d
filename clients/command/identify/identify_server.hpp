#pragma once

#include "clients/command/experiment/experiment_file.hpp"
#include "clients/command/identify/identify.hpp"
#include "clients/command/identify/identify_data.hpp"

namespace drivebench::command {

/// What is to run, and where if no bench for it is found.
struct WantedExperiment {
  ExperimentFile file;
  std::string bench;         ///< to start a server on; empty: none is known
  std::string_view machine;  ///< kind that the axis must have
};

/// Runs the experiment on a server and fetches its data: on that of the link if its bench has the axis, else
/// on one of our own, which ends with this call. Throws UsageError if the bench is not the right one,
/// std::runtime_error if the experiment does not come to its end.
Measurement measure(const IdentifyOptions& options, const WantedExperiment& wanted);

}  // namespace drivebench::command
