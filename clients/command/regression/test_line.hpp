#pragma once

namespace drivebench::command {

class CommandLine;

/// Adds `test` and `rerun`.
void add_regression_commands(CommandLine& line);

}  // namespace drivebench::command
