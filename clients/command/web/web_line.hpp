#pragma once

namespace drivebench::command {

class CommandLine;

/// web.
void add_web_command(CommandLine& line);

}  // namespace drivebench::command
