#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "clients/command/demo/demo_report.hpp"

namespace drivebench::command {

std::string demo_json(const DemoReport& report);

// Parses a line of drivebench-server; nothing for any other line.
std::optional<ServerVerdict> parse_verdict(std::string_view line);
std::optional<DemoReplay> parse_replay(std::string_view line);

}  // namespace drivebench::command
