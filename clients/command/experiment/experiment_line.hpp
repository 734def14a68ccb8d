#pragma once

namespace drivebench::command {

class CommandLine;

/// experiment run, list, fetch and cancel.
void add_experiment_commands(CommandLine& line);

}  // namespace drivebench::command
