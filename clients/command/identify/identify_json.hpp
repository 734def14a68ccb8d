#pragma once

#include <string>

#include "clients/command/identify/identify_report.hpp"

namespace drivebench::command {

/// The JSON of identification::to_json() with experiment, settings and validation.
std::string identify_json(const IdentifyReport& report);
/// Motors and their experiments.
std::string named_experiments_json();

}  // namespace drivebench::command
