#include <cmath>
#include <nlohmann/json.hpp>

#include "clients/regression/reports/reports.hpp"
#include "protocols/text.hpp"

#include <fmt/format.h>

namespace drivebench::regression {
namespace {

using Json = nlohmann::ordered_json;

/// JSON has no infinity and no NaN.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json finding_json(const Finding& finding) {
  return {{"name", finding.name},
          {"kind", finding.kind},
          {"axis", finding.axis},
          {"signal", finding.signal},
          {"passed", finding.passed},
          {"applied", finding.applied},
          {"measured", number(finding.measured)},
          {"limit", number(finding.limit)},
          {"unit", finding.unit},
          {"at_s", number(finding.at_s)},
          {"from_s", finding.from_s},
          {"to_s", finding.to_s},
          {"line", finding.line},
          {"sentence", finding.sentence}};
}

Json case_json(const CaseResult& result) {
  Json values = Json::object();
  for (const auto& [label, value] : result.values)
    values[label] = value;
  Json checks = Json::array();
  for (const Finding& finding : result.findings)
    checks.push_back(finding_json(finding));
  return {{"name", result.name},
          {"file", result.file},
          {"values", values},
          {"tags", result.tags},
          {"verdict", word_of(result.verdict)},
          {"reason", result.reason},
          {"bench_s", result.bench_s},
          {"samples", result.samples},
          {"hash", fmt::format("{:016x}", result.hash)},
          {"checks", checks},
          {"output", utf8(result.output)}};
}

}  // namespace

std::string to_json(const std::string& suite, std::span<const CaseResult> results) {
  const Totals totals = totals_of(results);
  Json cases = Json::array();
  for (const CaseResult& result : results)
    cases.push_back(case_json(result));
  const Json report = {{"suite", suite},          {"passed", totals.passed},   {"failed", totals.failed},
                       {"errors", totals.errors}, {"invalid", totals.invalid}, {"skipped", totals.skipped},
                       {"cases", cases}};
  return report.dump(1) + "\n";
}

}  // namespace drivebench::regression
