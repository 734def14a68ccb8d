#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "clients/command/common/commands.hpp"

namespace drivebench::command {

/// Adds `experiment` with its own subcommands to the command line. `choose` gets the one that was named, when
/// `options` hold what was said.
void add_experiment_commands(CLI::App& app, LinkChoice& link, bool& json, ExperimentOptions& options,
                             const std::function<void(int (*)(const ExperimentOptions&))>& choose);

}  // namespace drivebench::command
