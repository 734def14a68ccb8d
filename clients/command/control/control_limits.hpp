#pragma once

#include <string>
#include <vector>

/// Limits for the numbers of a report: `drivebench control --expect`.
namespace drivebench::command {

struct Limit {
  std::string name;  ///< as in the report's JSON
  bool at_most = true;
  double value = 0.0;
};

/// "peak_error_counts<=2" or ">=". Throws UsageError, also for a name that no report has.
Limit parse_limit(const std::string& text);

/// A sentence for each limit that the report does not keep. A number that the link does not carry keeps none.
std::vector<std::string> broken(const std::vector<Limit>& limits, const std::string& report_json);

}  // namespace drivebench::command
