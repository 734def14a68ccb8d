#pragma once

namespace drivebench::command {

class CommandLine;

void add_convert_commands(CommandLine& line);

}  // namespace drivebench::command
