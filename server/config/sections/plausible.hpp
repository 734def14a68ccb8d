#pragma once

#include <filesystem>
#include <vector>

#include "plant/axis_parameters.hpp"
#include "plant/problem.hpp"
#include "server/config/config.hpp"

namespace drivebench {

/// Values that keep all rules but are implausible for the kind of machine, mostly because of a mixed-up unit.
std::vector<Problem> oddities(const AxisParameters& p);

/// Like the other load_config(), and collects implausible values. A ConfigError lists them behind its
/// problems.
BenchConfig load_config(const std::filesystem::path& file, std::vector<ConfigProblem>& odd);

}  // namespace drivebench
