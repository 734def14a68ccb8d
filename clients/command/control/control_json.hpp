#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/control/control_compare.hpp"
#include "clients/command/control/control_run.hpp"
#include "clients/control/gains/gains.hpp"

namespace drivebench::command {

std::string presets_json();
std::string gains_json(const std::vector<control::Gain>& gains);
std::string comparison_json(const Comparison& comparison);
std::string control_json(const ControlReport& report);
/// Parses a report of control_json(); nothing for any other line.
std::optional<ControlReport> parse_control(std::string_view line);

}  // namespace drivebench::command
