#pragma once

namespace drivebench::command {

class CommandLine;

void add_doctor_command(CommandLine& line);

}  // namespace drivebench::command
