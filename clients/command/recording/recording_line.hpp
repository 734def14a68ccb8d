#pragma once

namespace drivebench::command {

class CommandLine;

/// replay and export.
void add_recording_commands(CommandLine& line);

}  // namespace drivebench::command
