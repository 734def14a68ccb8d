#include "clients/regression/reports/case_json.hpp"
#include "clients/regression/reports/reports.hpp"

namespace drivebench::regression {

std::string to_json(const std::string& suite, std::span<const CaseResult> results) {
  using Json = nlohmann::ordered_json;
  const Totals totals = totals_of(results);
  Json cases = Json::array();
  for (const CaseResult& result : results)
    cases.push_back(case_json(result));
  const Json report = {{"suite", suite},          {"passed", totals.passed},   {"failed", totals.failed},
                       {"errors", totals.errors}, {"invalid", totals.invalid}, {"skipped", totals.skipped},
                       {"cases", cases}};
  return report.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace drivebench::regression
