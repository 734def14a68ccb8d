#pragma once

#include <cstdint>
#include <string>

#include "clients/command/experiment/experiment_client.hpp"

namespace drivebench::command {

/// The options of the verbs of `experiment`; each verb uses some of them.
struct ExperimentOptions {
  ExperimentServer server{};
  bool json = false;
  std::string file{};  ///< run: the experiment file
  std::uint64_t id = 0;
  /// CSV, or the recording if it ends with .mcap; empty: fetch writes to standard output.
  std::string out_file{};
  bool detach = false;  ///< run: do not wait for its end
};
int run_experiment_run(const ExperimentOptions& options);
int run_experiment_list(const ExperimentOptions& options);
int run_experiment_fetch(const ExperimentOptions& options);
int run_experiment_cancel(const ExperimentOptions& options);

}  // namespace drivebench::command
