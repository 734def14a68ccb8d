#include "clients/command/regression/test.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/temporary_folder.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/regression/bundles/bundle.hpp"
#include "clients/command/regression/failures/shrink_case.hpp"
#include "clients/command/regression/pages/html_report.hpp"
#include "clients/command/regression/slurm.hpp"
#include "clients/command/regression/stored_results.hpp"
#include "clients/command/regression/suite_run.hpp"
#include "clients/regression/reports/reports.hpp"
#include "clients/regression/results/shard.hpp"
#include "clients/regression/suite/case_file.hpp"
#include "clients/regression/timing/timing_report.hpp"
#include "protocols/nearest_name.hpp"

namespace drivebench::command {
namespace {

using regression::Case;
using regression::CaseResult;
using regression::SuiteResults;

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

/// Shows the cases of the suite that the options choose. One at least has the filter and the tags; the shard
/// may have none of them.
void visit_chosen(const TestOptions& options, const std::filesystem::path& suite,
                  const regression::SeeCase& see) {
  const regression::Shard shard = wanted_shard(options);
  std::size_t all = 0;
  std::size_t wanted = 0;
  try {
    regression::visit_suite(suite, [&](Case c) {
      ++all;
      if (is_wanted(c, options) && shard.has(wanted++)) see(std::move(c));
    });
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
  if (wanted == 0) throw UsageError(fmt::format("none of the {} cases has this filter and these tags", all));
}

std::vector<Case> chosen_cases(const TestOptions& options, const std::filesystem::path& suite) {
  std::vector<Case> cases;
  visit_chosen(options, suite, [&cases](Case c) { cases.push_back(std::move(c)); });
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
                                              const std::filesystem::path& folder, unsigned jobs) {
  try {
    return prepare(cases, folder, jobs);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

/// The files of the reports, opened before the run: a missing folder must not cost the results.
struct ReportFiles {
  std::optional<Output> junit{};
  std::optional<Output> json{};
  std::optional<Output> html{};
  std::optional<Output> timing{};

  explicit ReportFiles(const TestOptions& options) {
    if (!options.junit_file.empty()) junit.emplace(options.junit_file);
    if (!options.json_file.empty()) json.emplace(options.json_file);
    if (!options.html_file.empty()) html.emplace(options.html_file);
    if (!options.timing_file.empty()) timing.emplace(options.timing_file);
  }
};

/// Writes the reports that go into files and need no more than the results.
void write_files(ReportFiles& files, const SuiteResults& results) {
  std::vector<std::unique_ptr<regression::Report>> reports;
  const auto into = [](Output& file) { return [&file](std::string_view text) { file.write(text); }; };
  if (files.junit) reports.push_back(regression::junit_report(into(*files.junit)));
  if (files.json) reports.push_back(regression::json_report(into(*files.json)));
  regression::write_reports(results, reports);
  for (std::optional<Output>* const file : {&files.junit, &files.json})
    if (*file) (*file)->flush();
}

void print(std::unique_ptr<regression::Report> (*report)(regression::Sink), const SuiteResults& results) {
  const std::array reports{report([](std::string_view text) { fmt::print("{}", text); })};
  regression::write_reports(results, reports);
}

/// The results that a folder has already, and the cases that it lacks.
struct Work {
  std::vector<CaseResult> results{};  ///< of all cases, in their order; blank where one is missing
  std::vector<Case> missing{};
  std::vector<std::size_t> places{};        ///< of the missing cases
  std::vector<std::string> fingerprints{};  ///< of the missing cases, if results are kept

  std::size_t known() const noexcept { return results.size() - places.size(); }
};

Work work_of(std::vector<Case> cases, StoredResults* stored) {
  Work work;
  for (Case& c : cases) {
    const std::string fingerprint = stored != nullptr ? stored->fingerprint_of(c) : std::string();
    std::optional<CaseResult> found = stored != nullptr ? stored->find(c.name, fingerprint) : std::nullopt;
    // In real time the machine may do better another time.
    if (found && found->verdict == regression::Verdict::kInvalid) found.reset();
    if (found) {
      work.results.push_back(std::move(*found));
      continue;
    }
    work.places.push_back(work.results.size());
    work.fingerprints.push_back(fingerprint);
    work.results.emplace_back();
    work.missing.push_back(std::move(c));
  }
  return work;
}

SuiteSettings settings_of(const TestOptions& options, const Work& work, const StoredResults* stored) {
  SuiteSettings settings{.jobs = options.jobs,
                         .retries = options.retries,
                         .draws_plots = stored != nullptr || !options.html_file.empty(),
                         .measures_timing = !options.timing_file.empty(),
                         .keep_folder = options.keep_folder,
                         .program = options.program};
  if (stored != nullptr) {
    settings.store = [&work, stored](std::size_t place, const CaseResult& result) {
      if (!interrupted()) stored->put(result, work.fingerprints[place]);
    };
  }
  return settings;
}

/// How to run a case again that has left a bundle; empty: it has left none.
std::string rerun_line(const CaseResult& result, const TestOptions& options) {
  using enum regression::Verdict;
  if (options.keep_folder.empty() || result.verdict == kPass || result.verdict == kSkipped) return {};
  const std::filesystem::path bundle = bundle_of(options.keep_folder, result.name);
  std::error_code none;
  if (!std::filesystem::exists(bundle, none)) return {};
  return fmt::format("        drivebench rerun '{}'\n", bundle.string());
}

/// Runs the missing cases, and prints a row for each.
void run_missing(Work& work, const TestOptions& options, const StoredResults* stored,
                 regression::TimingReport& timing) {
  if (work.missing.empty()) return;
  const TemporaryFolder folder;
  const std::vector<PreparedCase> prepared = prepared_or_refused(work.missing, folder.path(), options.jobs);
  catch_interrupts();
  Progress progress("test");
  const auto see = [&](const CaseResult& result, std::size_t ended) {
    progress.update(static_cast<double>(ended) / static_cast<double>(prepared.size()),
                    fmt::format("{} of {} cases", ended, prepared.size()));
    if (!options.tap) fmt::print("{}{}", regression::table_row(result), rerun_line(result, options));
    std::fflush(stdout);  // a pipe, too, tells each case as it ends
    if (result.timing) timing.add(result.name, *result.timing);
  };
  std::vector<CaseResult> made = run_suite(prepared, folder.path(), settings_of(options, work, stored), see);
  for (std::size_t i = 0; i < made.size(); ++i)
    work.results[work.places[i]] = std::move(made[i]);
}

void print_bad(const CaseResult& result, const TestOptions& options) {
  if (!options.tap && !regression::is_good(result)) fmt::print("{}", regression::table_row(result));
}

/// A folder that takes nothing must not cost the run. It need not exist yet.
void require_writable(std::string_view option, const std::string& folder) {
  if (folder.empty()) return;
  std::filesystem::path place = std::filesystem::absolute(folder);
  std::error_code none;
  while (place.has_relative_path() && !std::filesystem::exists(place, none))
    place = place.parent_path();
  if (!std::filesystem::is_directory(place, none))
    throw UsageError(fmt::format("{}: {} is no folder", option, place.string()));
  if (::access(place.c_str(), W_OK | X_OK) == 0) return;
  throw UsageError(fmt::format("{}: cannot write into {}: {}", option, place.string(),
                               std::generic_category().message(errno)));
}

/// Runs the cases without a result. Of those that have one from before, the ones that have not passed are
/// printed.
Work run_cases(const TestOptions& options, const std::filesystem::path& suite,
               regression::TimingReport& timing) {
  require_writable("--results", options.results_folder);
  require_writable("--keep", options.keep_folder);
  std::optional<StoredResults> stored;
  if (!options.results_folder.empty()) stored.emplace(options.program, std::vector{options.results_folder});
  Work work = work_of(chosen_cases(options, suite), stored ? &*stored : nullptr);
  for (const CaseResult& result : work.results)
    if (!result.name.empty()) print_bad(result, options);
  run_missing(work, options, stored ? &*stored : nullptr, timing);
  return work;
}

void require_folders(const std::vector<std::string>& folders) {
  std::error_code error;
  for (const std::string& folder : folders) {
    if (!std::filesystem::is_directory(folder, error))
      throw UsageError(fmt::format("--merge: {} is no folder", folder));
  }
}

/// The results in the folders, read each time that they are shown.
regression::EachResult merged_results(const TestOptions& options, const std::filesystem::path& suite,
                                      StoredResults& stored) {
  return [&options, suite, &stored](const regression::SeeResult& see) {
    visit_chosen(options, suite, [&](const Case& c) {
      if (const auto result = stored.find(c.name, stored.fingerprint_of(c))) return see(*result);
      CaseResult none{.name = c.name, .file = c.file, .line = c.line, .values = c.values, .tags = c.tags};
      none.reason = "no folder has a result of this case as it is now";
      see(none);
    });
  };
}

/// Writes all reports. Returns the exit code.
int report(const TestOptions& options, SuiteResults results, ReportFiles& files, const std::string& remark,
           const regression::SeeResult& see_first) {
  HtmlReport html(options.keep_folder, std::filesystem::path(options.html_file).parent_path());
  results.each([&](const CaseResult& result) {
    results.totals.add(result);
    if (files.html) html.add(result);
    see_first(result);
  });
  write_files(files, results);
  if (files.html) {
    files.html->write(html.page(results.suite, results.totals));
    files.html->flush();
  }
  if (options.tap) {
    print(regression::tap_report, results);
  } else {
    fmt::print("{}; {:.4g} s of the bench{}\n", regression::totals_text(results.totals),
               results.totals.bench_s, remark);
  }
  if (options.github) print(regression::github_report, results);
  return exit_code_of(results.totals);
}

int merge(const TestOptions& options, const std::filesystem::path& suite) {
  require_folders(options.merged_folders);
  ReportFiles files(options);
  StoredResults stored(options.program, options.merged_folders);
  return report(options, {suite.stem().string(), {}, merged_results(options, suite, stored)}, files, "",
                [&options](const CaseResult& result) { print_bad(result, options); });
}

regression::TimingReport empty_timing_report(const TestOptions& options) {
  using enum regression::TimingReport::Format;
  if (!options.timing_file.empty() && !std::filesystem::path(options.timing_file).has_extension())
    throw UsageError(
        fmt::format("cannot write {}: the name must end with .json or .html", options.timing_file));
  check_suffix(options.timing_file, {".json", ".html"});
  return regression::TimingReport(options.timing_file.ends_with(".json") ? kJson : kPage);
}

int run_and_report(const TestOptions& options, const std::filesystem::path& suite) {
  regression::TimingReport timing = empty_timing_report(options);
  ReportFiles files(options);
  const auto started = std::chrono::steady_clock::now();
  const Work work = run_cases(options, suite, timing);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  const auto each = [&work](const regression::SeeResult& see) { std::ranges::for_each(work.results, see); };
  const std::string remark =
      fmt::format(" in {:.3g} s{}", wall_s,
                  work.known() > 0 ? fmt::format("; {} of the results are from before", work.known()) : "");
  const int code =
      report(options, {suite.stem().string(), {}, each}, files, remark, [](const CaseResult&) {});
  if (files.timing) {
    files.timing->write(timing.text(suite.stem().string()));
    files.timing->flush();
    if (!options.tap) fmt::print("{}", timing.summary());
  }
  return code;
}

/// Prints how many of the cases have a result, and what becomes of the job that was submitted for them.
/// Returns 0 if all have one, and none is to run again.
int print_status(const TestOptions& options, const std::filesystem::path& suite) {
  StoredResults stored(options.program, {options.results_folder});
  const Work work = work_of(chosen_cases(options, suite), &stored);
  regression::Totals totals;
  for (const CaseResult& result : work.results) {
    if (!result.name.empty()) totals.add(result);
  }
  fmt::print("{} of {} cases have a result: {}\n", work.known(), work.results.size(),
             regression::totals_text(totals));
  if (const std::string state = slurm_state(options.results_folder); !state.empty())
    fmt::print("{}\n", state);
  return work.places.empty() ? kExitOk : kExitFailed;
}

/// A mistake in a case is told before anything is submitted.
int submit(const TestOptions& options, const std::filesystem::path& suite) {
  chosen_cases(options, suite);
  return submit_to_slurm(options, suite);
}

}  // namespace

int exit_code_of(const regression::Totals& totals) {
  if (totals.failed + totals.errors != 0) return kExitFailed;
  return totals.invalid != 0 ? kExitInvalid : kExitOk;
}

int run_test(const TestOptions& options) {
  const ShrinkOptions shrink{.file = options.shrunk_file, .most_runs = options.shrink_runs};
  if (!shrink.file.empty() && options.suite.ends_with(".zip")) {
    if (!options.filter.empty() || !options.wanted_tags.empty())
      throw UsageError("--filter and --tag choose from a suite, but a bundle has one case");
    return run_shrink_bundle(shrink, options.suite);
  }
  const std::filesystem::path suite = find_suite(options.suite);
  if (options.list) {
    print_list(chosen_cases(options, suite));
    return kExitOk;
  }
  if (options.status) return print_status(options, suite);
  if (options.slurm_tasks != 0) return submit(options, suite);
  if (!shrink.file.empty()) {
    const std::vector<Case> cases = chosen_cases(options, suite);
    if (cases.size() != 1) {
      throw UsageError(fmt::format(
          "--shrink: there are {} cases, but one is made smaller: choose it with --filter", cases.size()));
    }
    return run_shrink(shrink, cases.front());
  }
  return options.merged_folders.empty() ? run_and_report(options, suite) : merge(options, suite);
}

}  // namespace drivebench::command
