#pragma once

namespace drivebench::command {

class CommandLine;

/// Adds `test`.
void add_test_command(CommandLine& line);

}  // namespace drivebench::command
