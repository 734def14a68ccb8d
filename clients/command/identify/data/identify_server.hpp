#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "clients/command/experiment/experiment_file.hpp"
#include "clients/command/identify/data/identify_data.hpp"
#include "clients/command/identify/data/identify_options.hpp"

namespace drivebench::command {

/// An experiment to run, and a bench to start if no server has one for it.
struct WantedExperiment {
  ExperimentFile file;
  std::string bench;         ///< the bench to start; empty: none
  std::string_view machine;  ///< kind that the axis must have
};

/// A server that is started on a bench, by path or name, and ends with this object: for many experiments.
class OwnBench {
 public:
  /// Throws UsageError if the server does not take the bench.
  explicit OwnBench(const std::string& bench);
  OwnBench(const OwnBench&) = delete;
  OwnBench& operator=(const OwnBench&) = delete;
  ~OwnBench();

  /// What the bench says of the axis of this experiment; the data have a period and no columns. Adds the
  /// signals that identification needs.
  MeasuredMotor describe(WantedExperiment& wanted) const;

  /// Runs an experiment and fetches its data; WantedExperiment::bench and machine are of no effect. Throws
  /// std::runtime_error if the experiment does not complete.
  MeasuredMotor measure(const IdentifyOptions& options, const WantedExperiment& wanted) const;

 private:
  ExperimentServer experiments() const;

  std::unique_ptr<class OwnServer> server_;
};

/// Runs the experiment on a server and fetches its data: on the server of the link if its bench has the axis,
/// else on a server that this call starts and ends. Throws UsageError if the bench does not fit,
/// std::runtime_error if the experiment does not complete.
MeasuredMotor measure(const IdentifyOptions& options, const WantedExperiment& wanted);

}  // namespace drivebench::command
