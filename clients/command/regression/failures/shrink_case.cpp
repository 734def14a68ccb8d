#include "clients/command/regression/failures/shrink_case.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/temporary_folder.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/regression/bundles/bundle.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "clients/regression/checks/check_kinds.hpp"
#include "clients/regression/reports/reports.hpp"
#include "clients/regression/shrink/shrink.hpp"
#include "clients/regression/suite/case_file.hpp"
#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using regression::Case;
using regression::CaseResult;
using regression::Finding;
using regression::Verdict;

/// How a case fails: the first check that does, or the error.
struct Failure {
  Verdict verdict;
  std::string check;    ///< its name; empty: an error
  bool applied = true;  ///< whether the check saw anything
  std::string reason;   ///< of an error, without its times
};

/// "ended with code 2 at 0.01 s of 0.02 s" keeps its code: the numbers from " at " on are times. In a reason
/// without that word any number may be one.
std::string without_times(std::string text) {
  const std::size_t at = text.find(" at ");
  const auto from = text.begin() + static_cast<std::ptrdiff_t>(at == std::string::npos ? 0 : at);
  text.erase(std::remove_if(from, text.end(), [](char c) { return (c >= '0' && c <= '9') || c == '.'; }),
             text.end());
  return text;
}

const Finding* failed_check(const CaseResult& result) {
  const auto found = std::ranges::find(result.findings, false, &Finding::passed);
  return result.verdict == Verdict::kFail && found != result.findings.end() ? &*found : nullptr;
}

Failure failure_of(const CaseResult& result) {
  const Finding* const failed = failed_check(result);
  return {.verdict = result.verdict,
          .check = failed != nullptr ? failed->name : "",
          .applied = failed == nullptr || failed->applied,
          .reason = failed != nullptr ? "" : without_times(result.reason)};
}

bool is_same(const Failure& before, const CaseResult& result) {
  if (before.check.empty()) {
    const Failure now = failure_of(result);
    return now.verdict == before.verdict && now.check.empty() && now.reason == before.reason;
  }
  const auto same = [&before](const Finding& each) {
    return each.name == before.check && !each.passed && each.applied == before.applied;
  };
  return result.verdict == Verdict::kFail && std::ranges::any_of(result.findings, same);
}

/// Runs one table after the other, each in a folder of its own.
class Laboratory {
 public:
  explicit Laboratory(const Case& c) : case_(c) {}

  /// Throws ConfigError for a table that is no case of this bench.
  CaseResult run(const ConfigNode& table) { return run(regression::case_in(table, case_.file, case_.name)); }

  CaseResult run(const Case& candidate) {
    const fs::path folder = folder_.path() / std::to_string(runs_++);
    fs::create_directory(folder);
    const std::vector<PreparedCase> prepared = prepare({candidate}, folder, 1);
    CaseResult result = run_case(
        {.what = &candidate, .bench_file = prepared.front().bench_file, .facts = prepared.front().facts},
        folder, {});
    std::error_code ignored;
    fs::remove_all(folder, ignored);
    return result;
  }

  /// The result of a table that fails as the first one; nothing: it does not, or the run was interrupted.
  std::optional<CaseResult> failing(const Failure& before, const ConfigNode& table) {
    try {
      CaseResult result = run(table);
      if (!interrupted() && is_same(before, result)) return result;
    } catch (const ConfigError&) {
    } catch (const UsageError&) {
    }
    return std::nullopt;
  }

 private:
  const Case& case_;
  TemporaryFolder folder_;
  std::size_t runs_ = 0;
};

void refuse_what_cannot_shrink(const ShrinkOptions& options, const Case& c) {
  std::error_code none;
  const fs::path file(options.file);
  if (fs::exists(file, none)) throw UsageError(fmt::format("--shrink: {} exists already", options.file));
  if (file.extension() != ".toml")
    throw UsageError(fmt::format("--shrink: {} must end with .toml", options.file));
  if (c.is_realtime)
    throw UsageError(fmt::format("--shrink: {} runs in real time, where no run is repeated", c.name));
  if (!c.skip.empty()) throw UsageError(fmt::format("--shrink: {} is skipped: {}", c.name, c.skip));
}

/// The case finds its files from its folder.
void require_same_folder(const ShrinkOptions& options, const Case& c) {
  std::error_code none;
  const fs::path folder = fs::absolute(c.file).parent_path();
  if (fs::equivalent(fs::absolute(options.file).parent_path(), folder, none)) return;
  throw UsageError(fmt::format("--shrink: {} must be in {}, where the case has its files", options.file,
                               folder.lexically_normal().string()));
}

/// The files of a bundle's case, and where they will stand beside the smaller case. Throws UsageError if one
/// would replace another file.
std::vector<std::pair<fs::path, fs::path>> files_beside(const Case& c, const ShrinkOptions& options) {
  const fs::path folder = fs::path(c.file).parent_path();
  const fs::path target = fs::absolute(options.file).parent_path();
  std::vector<std::pair<fs::path, fs::path>> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file() || entry.path() == fs::path(c.file)) continue;
    files.emplace_back(entry.path(), target / fs::relative(entry.path(), folder));
    if (fs::exists(files.back().second)) {
      throw UsageError(fmt::format("--shrink: the bundle has a file for {}, which exists already",
                                   files.back().second.string()));
    }
  }
  return files;
}

/// Throws UsageError if the smaller case cannot be written: the search would be in vain.
void require_writable(const ShrinkOptions& options) {
  std::error_code error;
  fs::create_directories(fs::absolute(options.file).parent_path(), error);
  if (!error && !std::ofstream(options.file)) error = std::error_code(errno, std::generic_category());
  if (error) throw UsageError(fmt::format("--shrink: cannot write {}: {}", options.file, error.message()));
  fs::remove(options.file);
}

std::size_t leaves_in(const ConfigNode& table, std::string_view key) {
  const ConfigNode* const node = regression::find_child(table, key);
  return node == nullptr ? 0 : regression::leaf_count(*node);
}

std::size_t elements_in(const ConfigNode& table, std::string_view key) {
  const ConfigNode* const node = regression::find_child(table, key);
  return node == nullptr ? 0 : node->children.size();
}

/// The length that a case asks for, or else that of its run [s].
double length_s(const ConfigNode& table, const CaseResult& result) {
  const ConfigNode* const given = regression::find_child(table, "duration_s");
  return given == nullptr ? result.bench_s : regression::number_in(*given).value_or(result.bench_s);
}

/// The values of a case without its length, which is told by itself.
std::size_t values_in(const ConfigNode& table) {
  return regression::leaf_count(table) - leaves_in(table, "duration_s");
}

void print_outcome(const ShrinkOptions& options, const ConfigNode& before, const regression::Shrunk& shrunk,
                   const CaseResult& first, const CaseResult& last) {
  fmt::print("{}", regression::table_row(last));
  fmt::print(
      "{}: {} of {} steps, {} of {} checks, {} of {} overrides, {:.6g} s of {:.6g} s, {} of {} values; {} "
      "runs{}\n",
      options.file, elements_in(shrunk.table, "step"), elements_in(before, "step"),
      elements_in(shrunk.table, "check"), elements_in(before, "check"), leaves_in(shrunk.table, "override"),
      leaves_in(before, "override"), length_s(shrunk.table, last), length_s(before, first),
      values_in(shrunk.table), values_in(before), shrunk.runs,
      shrunk.is_smallest ? "" : "; it may become smaller with more, see --shrink-runs");
}

regression::ShrinkPlan plan_for(const ShrinkOptions& options, const CaseResult& first) {
  regression::ShrinkPlan plan{.check = 0, .most_runs = options.most_runs, .is_stopped = interrupted};
  const Finding* const failed = failed_check(first);
  if (failed != nullptr) plan.check = static_cast<std::size_t>(failed - first.findings.data());
  if (failed == nullptr || regression::fails_at_once(failed->kind)) plan.longest_s = first.bench_s;
  return plan;
}

/// Writes the smaller case under a comment on how sure it is.
void write_smaller(const ShrinkOptions& options, const Case& c, const ConfigNode& table,
                   std::string_view how) {
  write_file(options.file,
             fmt::format("# {}, made smaller: {}.\n{}", c.name, how, regression::toml_text(table)));
}

int shrink_into_file(const ShrinkOptions& options, const Case& c,
                     const std::vector<std::pair<fs::path, fs::path>>& files) {
  const ConfigNode table = regression::table_of(c);
  Laboratory laboratory(c);
  const CaseResult first = laboratory.run(table);
  end_if_interrupted();
  if (regression::is_good(first)) throw UsageError(fmt::format("--shrink: {} passes", c.name));
  fmt::print("{}", regression::table_row(first));
  const Failure failure = failure_of(first);
  CaseResult smallest = first;
  const auto still_fails = [&](const ConfigNode& candidate) {
    std::optional<CaseResult> result = laboratory.failing(failure, candidate);
    if (result) smallest = std::move(*result);
    return result.has_value();
  };
  const regression::Shrunk shrunk = regression::shrink(
      table, plan_for(options, first), still_fails,
      [](const std::string& what, std::size_t runs) { fmt::print("run {:>4}  {}\n", runs, what); });
  for (const auto& [from, to] : files) {
    fs::create_directories(to.parent_path());
    fs::copy_file(from, to);
  }
  write_smaller(options, c, shrunk.table, "it failed in the same way");
  const CaseResult last = laboratory.run(regression::read_suite(options.file).front());
  if (interrupted()) {
    print_outcome(options, table, shrunk, first, smallest);
    fmt::print("interrupted: {} is the smallest case so far, and was not run again\n", options.file);
    return kExitOk;
  }
  print_outcome(options, table, shrunk, first, last);
  if (!is_same(failure, last)) {
    write_smaller(options, c, shrunk.table, "it failed in the same way once, but does not fail each time");
    fmt::print("the case does not fail each time\n");
    return kExitFailed;
  }
  write_smaller(options, c, shrunk.table, "it fails in the same way");
  return kExitOk;
}

int shrink(const ShrinkOptions& options, const Case& c, bool brings_its_files) {
  refuse_what_cannot_shrink(options, c);
  std::vector<std::pair<fs::path, fs::path>> files;
  if (brings_its_files) {
    files = files_beside(c, options);
  } else {
    require_same_folder(options, c);
  }
  require_writable(options);
  try {
    return shrink_into_file(options, c, files);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

}  // namespace

int run_shrink(const ShrinkOptions& options, const Case& c) {
  catch_interrupts();
  return shrink(options, c, false);
}

int run_shrink_bundle(const ShrinkOptions& options, const std::string& bundle) {
  catch_interrupts();
  const TemporaryFolder folder;
  return shrink(options, unpack_bundle(bundle, folder.path()).what, true);
}

}  // namespace drivebench::command
