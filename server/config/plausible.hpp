#pragma once

#include <filesystem>
#include <vector>

#include "plant/axis_parameters.hpp"
#include "plant/problem.hpp"
#include "server/config/config.hpp"

namespace drivebench {

/// What is right by the rules, and yet hardly any machine of its kind is so: most often somebody took one
/// unit for another.
std::vector<Problem> oddities(const AxisParameters& p);

/// As the other load_config(), and says what is odd. Where something is wrong, what is odd stands behind it.
BenchConfig load_config(const std::filesystem::path& file, std::vector<ConfigProblem>& odd);

}  // namespace drivebench
