#pragma once

#include <filesystem>
#include <vector>

#include "clients/regression/suite/case.hpp"

namespace drivebench::regression {

/// The cases of a file, one for each combination of its matrix. `name` is that of the file within its suite.
/// Problems go to the list.
std::vector<Case> read_case_file(const std::filesystem::path& file, const std::string& name,
                                 ProblemList& problems);

/// The cases of a TOML file, or of all TOML files in and below a folder, by name. Throws ConfigError with all
/// problems, also for a suite without cases.
std::vector<Case> read_suite(const std::filesystem::path& suite);

}  // namespace drivebench::regression
