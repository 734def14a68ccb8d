#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "clients/regression/suite/case.hpp"

namespace drivebench::regression {

using SeeCase = std::function<void(Case)>;

/// Shows the cases of a TOML file, one for each combination of its matrix and its draws, or those of all TOML
/// files in and below a folder, by name. Throws ConfigError with all problems, also for a suite without
/// cases; some cases have been shown then.
void visit_suite(const std::filesystem::path& suite, const SeeCase& see);

/// The file of a case as it is now, with the values of its matrix and draws in their places and without the
/// two tables. Throws ConfigError.
ConfigNode table_of(const Case& c);

/// The case in a table as table_of() gives it, with the names of its files relative to `file`. Throws
/// ConfigError.
Case case_in(const ConfigNode& table, const std::filesystem::path& file, const std::string& name);

/// All cases of a suite. Throws ConfigError with all problems.
std::vector<Case> read_suite(const std::filesystem::path& suite);

}  // namespace drivebench::regression
