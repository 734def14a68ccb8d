#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace drivebench::command {

/// What drivebench-server says when it listens.
struct ServerReady {
  std::string tcp;
  std::string mode;
  std::string bench;
};

/// Of a line that drivebench-server prints with --json; nothing of any other line.
std::optional<ServerReady> parse_ready(std::string_view line);

}  // namespace drivebench::command
