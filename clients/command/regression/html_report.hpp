#pragma once

#include <span>
#include <string>

#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

/// The results of a suite as a page of one file that needs no network: every case with its values and checks,
/// and of those that have not passed the reasons, the signals of the failed checks with their limits, and
/// what the device under test printed. The plots need the traces of the results.
std::string html_report(const std::string& suite, std::span<const regression::CaseResult> results);

}  // namespace drivebench::command
