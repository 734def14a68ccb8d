#pragma once

#include <span>
#include <string>

#include "clients/regression/verdicts/result.hpp"

/// The results of a suite for people and for programs. Nothing in them depends on the wall clock or on the
/// order in which cases ended, so that equal runs give equal bytes.
namespace drivebench::regression {

struct Totals {
  std::size_t passed = 0;
  std::size_t failed = 0;
  std::size_t errors = 0;
  std::size_t invalid = 0;
  std::size_t skipped = 0;
};
Totals totals_of(std::span<const CaseResult> results) noexcept;

/// Passed or skipped.
bool is_good(const CaseResult& result) noexcept;

/// `12 passed, 1 failed, 1 skipped`; kinds that did not occur are left out.
std::string totals_text(const Totals& totals);

/// A case in the table on the terminal: its line, and below it what is wrong.
std::string table_row(const CaseResult& result);

/// The reasons why a case has not passed, one each.
std::vector<std::string> reasons_of(const CaseResult& result);

std::string to_json(const std::string& suite, std::span<const CaseResult> results);
std::string to_junit(const std::string& suite, std::span<const CaseResult> results);
std::string to_tap(std::span<const CaseResult> results);
/// Workflow commands that GitHub shows as annotations: a line for each case that has not passed.
std::string to_github(std::span<const CaseResult> results);

}  // namespace drivebench::regression
