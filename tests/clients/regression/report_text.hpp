#pragma once

#include <algorithm>
#include <string>
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
inline std::string text_of(void (*report)(const SuiteResults&, const Sink&),
                           std::vector<CaseResult> results) {
  std::string text;
  report(suite_results(std::move(results)), [&text](std::string_view part) { text += part; });
  return text;
}

}  // namespace drivebench::regression
