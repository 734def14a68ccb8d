#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/regression/verdicts/result.hpp"

/// The results of a suite for people and for programs. Nothing in them depends on the wall clock or on the
/// order in which cases ended, so that equal runs give equal bytes.
namespace drivebench::regression {

using SeeResult = std::function<void(const CaseResult&)>;
/// Shows every result of a run in the order of the cases; they need not be in memory at the same time.
using EachResult = std::function<void(const SeeResult&)>;
/// Takes a report part by part.
using Sink = std::function<void(std::string_view)>;

struct Totals {
  std::size_t passed = 0;
  std::size_t failed = 0;
  std::size_t errors = 0;
  std::size_t invalid = 0;
  std::size_t skipped = 0;
  double bench_s = 0.0;  ///< how long all cases lasted on their benches

  void add(const CaseResult& result) noexcept;
  std::size_t all() const noexcept { return passed + failed + errors + invalid + skipped; }
};

/// Passed or skipped.
bool is_good(const CaseResult& result) noexcept;

/// `12 passed, 1 failed, 1 skipped`; kinds that did not occur are left out.
std::string totals_text(const Totals& totals);

/// A case in the table on the terminal: its line, and below it what is wrong.
std::string table_row(const CaseResult& result);

/// The reasons why a case has not passed, one each.
std::vector<std::string> reasons_of(const CaseResult& result);

/// What every report tells: the name of the suite, the totals, and the results.
struct SuiteResults {
  std::string suite;
  Totals totals;
  EachResult each;
};

void write_json(const SuiteResults& results, const Sink& sink);
void write_junit(const SuiteResults& results, const Sink& sink);
void write_tap(const SuiteResults& results, const Sink& sink);
/// Workflow commands that GitHub shows as annotations: a line for each case that has not passed.
void write_github(const SuiteResults& results, const Sink& sink);

}  // namespace drivebench::regression
