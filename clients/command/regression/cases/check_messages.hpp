#pragma once

#include <filesystem>

#include "clients/regression/suite/case.hpp"

namespace drivebench::command {

/// Lets the server judge the messages of a case on its composed bench; what it refuses goes to the list, at
/// the lines of the steps. Opens no port.
void check_messages(const regression::Case& c, const std::filesystem::path& bench, ProblemList& problems);

}  // namespace drivebench::command
