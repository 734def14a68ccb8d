#pragma once

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/experiment/experiment_client.hpp"

namespace drivebench::command {

/// Adds --owner, with the default of `server`.
void add_owner(CLI::App& sub, ExperimentServer& server);

/// experiment run, list, fetch and cancel.
void add_experiment_commands(CommandLine& line);

}  // namespace drivebench::command
