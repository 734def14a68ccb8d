#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/regression/reports/reports.hpp"

namespace drivebench::regression {

inline SuiteResults suite_results(std::vector<CaseResult> results) {
  Totals totals;
  for (const CaseResult& result : results)
    totals.add(result);
  return {.suite = "s", .totals = totals, .each = [results = std::move(results)](const SeeResult& see) {
            std::ranges::for_each(results, see);
          }};
}

/// A report as one text.
inline std::string text_of(std::unique_ptr<Report> (*report)(Sink), std::vector<CaseResult> results) {
  std::string text;
  const std::array reports{report([&text](std::string_view part) { text += part; })};
  write_reports(suite_results(std::move(results)), reports);
  return text;
}

}  // namespace drivebench::regression
