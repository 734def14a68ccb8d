#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench::command {

/// The line of drivebench-server when it is ready.
struct ServerReady {
  std::string tcp;
  std::vector<std::string> can;  ///< the buses, as a link names them
  std::string modbus;            ///< empty: it is off
  std::string mode;
  std::string bench;
};

/// Parses the line that drivebench-server prints with --json; nothing for any other line.
std::optional<ServerReady> parse_ready(std::string_view line);

}  // namespace drivebench::command
