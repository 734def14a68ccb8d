#pragma once

namespace drivebench::command {

class CommandLine;

/// serve; describe, status, watch; inject, set, bump, take; dbc, can-table, modbus-map.
void add_bench_commands(CommandLine& line);

}  // namespace drivebench::command
