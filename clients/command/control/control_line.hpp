#pragma once

namespace drivebench::command {

class CommandLine;

/// control and plot, the verbs that need a preset.
void add_control_commands(CommandLine& line);

}  // namespace drivebench::command
