#pragma once

#include <span>
#include <string>

#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

/// What the checks measured over many cases, as a table of HTML: for each check of each case file the number
/// of cases, smallest, median and largest value with a histogram, and the case that came closest to its limit
/// or went furthest beyond.
std::string statistics_table(std::span<const regression::CaseResult> results);

}  // namespace drivebench::command
