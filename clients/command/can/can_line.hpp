#pragma once

namespace drivebench::command {

class CommandLine;

/// can check and can-log.
void add_can_commands(CommandLine& line);

}  // namespace drivebench::command
