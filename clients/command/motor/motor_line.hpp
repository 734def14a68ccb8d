#pragma once

namespace drivebench::command {

class CommandLine;

/// steady-state.
void add_motor_commands(CommandLine& line);

}  // namespace drivebench::command
