#pragma once

namespace drivebench::command {

class CommandLine;

/// new motor and new bench.
void add_datasheet_commands(CommandLine& line);

}  // namespace drivebench::command
