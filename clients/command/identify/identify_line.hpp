#pragma once

namespace drivebench::command {

class CommandLine;

void add_identify_commands(CommandLine& line);

}  // namespace drivebench::command
