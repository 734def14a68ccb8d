#include "clients/command/regression/test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "clients/command/common/errors.hpp"
#include "clients/command/common/installation.hpp"
#include "clients/command/common/output.hpp"
#include "clients/command/common/session.hpp"
#include "clients/command/regression/html_report.hpp"
#include "clients/command/regression/suite_run.hpp"
#include "clients/regression/reports/reports.hpp"
#include "clients/regression/suite/case_file.hpp"
#include "protocols/nearest_name.hpp"

namespace drivebench::command {
namespace {

using regression::Case;
using regression::CaseResult;

bool is_wanted(const Case& c, const TestOptions& options) {
  const auto has_tag = [&c](const std::string& tag) {
    return std::ranges::find(c.tags, tag) != c.tags.end();
  };
  return c.name.find(options.filter) != std::string::npos &&
         std::ranges::all_of(options.wanted_tags, has_tag);
}

/// The cases of the suite that the options choose; one at least.
std::vector<Case> chosen_cases(const TestOptions& options, const std::filesystem::path& suite) {
  std::vector<Case> cases;
  try {
    cases = regression::read_suite(suite);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
  const std::size_t all = cases.size();
  std::erase_if(cases, [&](const Case& c) { return !is_wanted(c, options); });
  if (cases.empty())
    throw UsageError(fmt::format("none of the {} cases has this filter and these tags", all));
  return cases;
}

void print_list(const std::vector<Case>& cases) {
  for (const Case& c : cases) {
    fmt::print("{}", c.name);
    if (!c.tags.empty()) fmt::print("  #{}", fmt::join(c.tags, " #"));
    if (!c.skip.empty()) fmt::print("  skipped: {}", c.skip);
    fmt::print("\n");
  }
}

std::vector<PreparedCase> prepared_or_refused(const std::vector<Case>& cases,
                                              const std::filesystem::path& folder) {
  try {
    return prepare(cases, folder);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

/// The files of the reports, opened before the run: a missing folder must not cost the results.
struct ReportFiles {
  std::optional<Output> junit{};
  std::optional<Output> json{};
  std::optional<Output> html{};

  explicit ReportFiles(const TestOptions& options) {
    if (!options.junit_file.empty()) junit.emplace(options.junit_file);
    if (!options.json_file.empty()) json.emplace(options.json_file);
    if (!options.html_file.empty()) html.emplace(options.html_file);
  }
};

void write(std::optional<Output>& file, const std::string& text) {
  if (!file) return;
  file->write(text);
  file->flush();
}

int exit_code_of(const regression::Totals& totals) {
  if (totals.failed + totals.errors != 0) return kExitFailed;
  return totals.invalid != 0 ? kExitInvalid : kExitOk;
}

void print_summary(const std::vector<CaseResult>& results, double wall_s) {
  double bench_s = 0.0;
  for (const CaseResult& result : results)
    bench_s += result.bench_s;
  fmt::print("{}; {:.4g} s of the bench in {:.3g} s\n",
             regression::totals_text(regression::totals_of(results)), bench_s, wall_s);
}

std::vector<CaseResult> run_all(const std::vector<PreparedCase>& cases, const std::filesystem::path& folder,
                                const TestOptions& options) {
  Progress progress("test");
  const SuiteSettings settings{
      .jobs = options.jobs, .keeps_traces = !options.html_file.empty(), .keep_folder = options.keep_folder};
  return run_suite(cases, folder, settings, [&](const CaseResult& result, std::size_t ended) {
    progress.update(static_cast<double>(ended) / static_cast<double>(cases.size()),
                    fmt::format("{} of {} cases", ended, cases.size()));
    if (!options.tap) fmt::print("{}", regression::table_row(result));
  });
}

}  // namespace

int run_test(const TestOptions& options) {
  const std::filesystem::path suite = find_suite(options.suite);
  const std::vector<Case> cases = chosen_cases(options, suite);
  if (options.list) {
    print_list(cases);
    return kExitOk;
  }
  ReportFiles files(options);
  const TemporaryFolder folder;
  const std::vector<PreparedCase> prepared = prepared_or_refused(cases, folder.path());
  catch_interrupts();
  const auto started = std::chrono::steady_clock::now();
  const std::vector<CaseResult> results = run_all(prepared, folder.path(), options);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();

  const std::string name = suite.stem().string();
  write(files.junit, regression::to_junit(name, results));
  write(files.json, regression::to_json(name, results));
  if (files.html) write(files.html, html_report(name, results));
  if (options.tap) {
    fmt::print("{}", regression::to_tap(results));
  } else {
    print_summary(results, wall_s);
  }
  if (options.github) fmt::print("{}", regression::to_github(results));
  return exit_code_of(regression::totals_of(results));
}

}  // namespace drivebench::command
