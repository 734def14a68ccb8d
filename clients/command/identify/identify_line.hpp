#pragma once

namespace drivebench::command {

class CommandLine;

void add_identify_command(CommandLine& line);

}  // namespace drivebench::command
