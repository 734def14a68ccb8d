#pragma once

namespace drivebench::command {

class CommandLine;

void add_demo_command(CommandLine& line);

}  // namespace drivebench::command
