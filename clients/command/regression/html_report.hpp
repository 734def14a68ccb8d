#pragma once

#include <span>
#include <string>
#include <vector>

#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

/// The signals of the failed checks with their limits as SVG pictures, from the trace of the result.
std::vector<std::string> plots_of(const regression::CaseResult& result);

/// The results of a suite as a page of one file that needs no network: every case with its values and checks,
/// and of those that have not passed the reasons, the signals of the failed checks with their limits, and
/// what the device under test printed. Of more than a thousand cases it shows statistics of what the checks
/// measured, and whole only the first hundred that have not passed.
std::string html_report(const std::string& suite, std::span<const regression::CaseResult> results);

}  // namespace drivebench::command
