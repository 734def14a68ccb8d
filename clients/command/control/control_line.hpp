#pragma once

namespace drivebench::command {

class CommandLine;

/// control and plot: what needs a preset.
void add_control_commands(CommandLine& line);

}  // namespace drivebench::command
