#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
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

/// A report that is written part by part: what comes before the results, each result, what comes after them.
class Report {
 public:
  explicit Report(Sink sink) : sink_(std::move(sink)) {}
  virtual ~Report() = default;
  Report(const Report&) = delete;
  Report& operator=(const Report&) = delete;
  Report(Report&&) = delete;
  Report& operator=(Report&&) = delete;

  virtual void begin(const std::string& suite, const Totals& totals) = 0;
  virtual void add(const CaseResult& result) = 0;
  virtual void end() {}

 protected:
  void write(std::string_view text) const { sink_(text); }

 private:
  Sink sink_;
};

std::unique_ptr<Report> json_report(Sink sink);
std::unique_ptr<Report> junit_report(Sink sink);
std::unique_ptr<Report> tap_report(Sink sink);
/// Workflow commands that GitHub shows as annotations: a line for each case that has not passed.
std::unique_ptr<Report> github_report(Sink sink);

/// Writes all reports while the results are shown once: reading them again costs the most.
void write_reports(const SuiteResults& results, std::span<const std::unique_ptr<Report>> reports);

}  // namespace drivebench::regression
