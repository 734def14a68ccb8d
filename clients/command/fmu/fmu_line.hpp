#pragma once

namespace drivebench::command {

class CommandLine;

/// fmu.
void add_fmu_command(CommandLine& line);

}  // namespace drivebench::command
