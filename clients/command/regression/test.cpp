#include "clients/command/regression/test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <optional>
#include <stdexcept>

#include "clients/command/common/errors.hpp"
#include "clients/command/common/installation.hpp"
#include "clients/command/common/output.hpp"
#include "clients/command/common/session.hpp"
#include "clients/command/regression/html_report.hpp"
#include "clients/command/regression/stored_results.hpp"
#include "clients/command/regression/suite_run.hpp"
#include "clients/regression/reports/reports.hpp"
#include "clients/regression/results/shard.hpp"
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

regression::Shard wanted_shard(const TestOptions& options) {
  if (options.shard.empty()) return {};
  try {
    return regression::shard_of(options.shard, [](const char* name) { return std::getenv(name); });
  } catch (const std::invalid_argument& problem) {
    throw UsageError(fmt::format("--shard: {}", problem.what()));
  }
}

/// The cases of the suite that the options choose. One at least has the filter and the tags; the shard may
/// have none of them.
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
  const regression::Shard shard = wanted_shard(options);
  std::size_t place = 0;
  std::erase_if(cases, [&](const Case&) { return !shard.has(place++); });
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

void print_summary(const std::vector<CaseResult>& results, std::size_t known, double wall_s) {
  double bench_s = 0.0;
  for (const CaseResult& result : results)
    bench_s += result.bench_s;
  fmt::print("{}; {:.4g} s of the bench in {:.3g} s{}\n",
             regression::totals_text(regression::totals_of(results)), bench_s, wall_s,
             known > 0 ? fmt::format("; {} of the results are from before", known) : "");
}

SuiteSettings settings_of(const TestOptions& options, StoredResults* stored) {
  SuiteSettings settings{.jobs = options.jobs,
                         .draws_plots = stored != nullptr || !options.html_file.empty(),
                         .keep_folder = options.keep_folder};
  if (stored != nullptr) {
    settings.store = [stored](const CaseResult& result) {
      if (!interrupted()) stored->put(result);
    };
  }
  return settings;
}

/// Runs cases, and prints a row for each.
std::vector<CaseResult> run_all(const std::vector<Case>& cases, const TestOptions& options,
                                StoredResults* stored) {
  const TemporaryFolder folder;
  const std::vector<PreparedCase> prepared = prepared_or_refused(cases, folder.path());
  catch_interrupts();
  Progress progress("test");
  const auto see = [&](const CaseResult& result, std::size_t ended) {
    progress.update(static_cast<double>(ended) / static_cast<double>(cases.size()),
                    fmt::format("{} of {} cases", ended, cases.size()));
    if (!options.tap) fmt::print("{}", regression::table_row(result));
  };
  return run_suite(prepared, folder.path(), settings_of(options, stored), see);
}

/// The result of a case that no folder has.
CaseResult no_result(const Case& c) {
  CaseResult result{.name = c.name, .file = c.file, .line = c.line, .values = c.values, .tags = c.tags};
  result.reason = "no folder has a result of this case as it is now";
  return result;
}

void require_folders(const std::vector<std::string>& folders) {
  std::error_code error;
  for (const std::string& folder : folders) {
    if (!std::filesystem::is_directory(folder, error))
      throw UsageError(fmt::format("--merge: {} is no folder", folder));
  }
}

/// The results of all cases, in their order: those that a folder has, and those of the cases that it lacks,
/// which run now unless results are merged. Of the former, those that have not passed are printed.
std::vector<CaseResult> results_of(const std::vector<Case>& cases, const TestOptions& options,
                                   std::size_t& known) {
  const bool merges = !options.merged_folders.empty();
  require_folders(options.merged_folders);
  std::optional<StoredResults> stored;
  if (merges) stored.emplace(options.program, options.merged_folders);
  if (!options.results_folder.empty()) stored.emplace(options.program, std::vector{options.results_folder});
  std::vector<CaseResult> results;
  std::vector<Case> missing;
  std::vector<std::size_t> places;
  for (const Case& c : cases) {
    std::optional<CaseResult> found = stored ? stored->find(c) : std::nullopt;
    // In real time the machine may do better another time.
    if (found && !merges && found->verdict == regression::Verdict::kInvalid) found.reset();
    if (found) ++known;
    if (!found && !merges) {
      missing.push_back(c);
      places.push_back(results.size());
    }
    results.push_back(found ? std::move(*found) : no_result(c));
    if ((found || merges) && !options.tap && !regression::is_good(results.back()))
      fmt::print("{}", regression::table_row(results.back()));
  }
  if (missing.empty()) return results;
  std::vector<CaseResult> made = run_all(missing, options, stored ? &*stored : nullptr);
  for (std::size_t i = 0; i < made.size(); ++i)
    results[places[i]] = std::move(made[i]);
  return results;
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
  const auto started = std::chrono::steady_clock::now();
  std::size_t known = 0;
  const std::vector<CaseResult> results = results_of(cases, options, known);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();

  const std::string name = suite.stem().string();
  write(files.junit, regression::to_junit(name, results));
  write(files.json, regression::to_json(name, results));
  if (files.html) write(files.html, html_report(name, results));
  if (options.tap) {
    fmt::print("{}", regression::to_tap(results));
  } else {
    print_summary(results, known, wall_s);
  }
  if (options.github) fmt::print("{}", regression::to_github(results));
  return exit_code_of(regression::totals_of(results));
}

}  // namespace drivebench::command
