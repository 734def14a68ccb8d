#include "clients/command/regression/suite_run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "clients/command/common/session/session.hpp"
#include "clients/command/regression/bundles/bundle.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "clients/command/regression/pages/html_report.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using regression::CaseResult;

/// Workers take the next case from a counter, and put its result in its place.
class Crew {
 public:
  Crew(const std::vector<PreparedCase>& cases, const fs::path& folder, const SuiteSettings& settings)
      : cases_(cases), folder_(folder), settings_(settings), results_(cases.size()) {
    const std::size_t workers = std::min<std::size_t>(std::max(1U, settings.jobs), cases.size());
    for (std::size_t i = 0; i < workers; ++i)
      workers_.emplace_back([this] { work(); });
  }

  /// Waits for the result of a case.
  CaseResult result_of(std::size_t index, std::size_t& ended) {
    std::unique_lock lock(mutex_);
    ready_.wait(lock, [&] { return results_[index].has_value(); });
    ended = ended_;
    return std::move(*results_[index]);
  }

 private:
  void work() {
    for (std::size_t index = next_++; index < cases_.size(); index = next_++) {
      const fs::path folder = folder_ / std::to_string(index);
      CaseResult result = run(cases_[index], folder);
      result.plots = plots_of(result);
      result.trace = {};
      keep(cases_[index], folder, result);
      store(index, result);
      std::error_code ignored;
      fs::remove_all(folder, ignored);
      const std::lock_guard lock(mutex_);
      results_[index] = std::move(result);
      ++ended_;
      ready_.notify_one();
    }
  }

  /// Runs a case, and again if the bench was late. Only one case at a time has the bus of an attached drive.
  CaseResult run(const PreparedCase& prepared, const fs::path& folder) {
    using enum regression::DeviceUnderTest::Kind;
    std::unique_lock bus(bus_, std::defer_lock);
    if (prepared.what->device.kind == kAttached) bus.lock();
    for (unsigned retries = 0;; ++retries) {
      fs::create_directory(folder);
      CaseResult result =
          run_case(prepared, folder, {.trace = settings_.draws_plots, .timing = settings_.measures_timing});
      if (result.verdict != regression::Verdict::kInvalid || interrupted()) return result;
      if (retries == settings_.retries) {
        if (retries != 0) result.reason += fmt::format(", in the last of {} runs", retries + 1);
        return result;
      }
      fs::remove_all(folder);
    }
  }

  void keep(const PreparedCase& prepared, const fs::path& folder, CaseResult& result) const {
    using enum regression::Verdict;
    if (settings_.keep_folder.empty() || result.verdict == kPass || result.verdict == kSkipped) return;
    try {
      record_case(prepared, folder);
      write_bundle(bundle_of(settings_.keep_folder, result.name), {.what = *prepared.what,
                                                                   .result = result,
                                                                   .bench_file = prepared.bench_file,
                                                                   .recording = recording_in(folder),
                                                                   .program = settings_.program});
    } catch (const std::exception& error) {
      result.reason += fmt::format("{}not kept: {}", result.reason.empty() ? "" : "; ", error.what());
    }
  }

  void store(std::size_t place, CaseResult& result) const {
    if (!settings_.store) return;
    try {
      settings_.store(place, result);
    } catch (const std::exception& error) {
      result.verdict = regression::Verdict::kError;
      result.reason = error.what();
    }
  }

  const std::vector<PreparedCase>& cases_;
  fs::path folder_;
  SuiteSettings settings_;
  std::mutex bus_;
  std::mutex mutex_;
  std::condition_variable ready_;
  std::vector<std::optional<CaseResult>> results_;
  std::size_t ended_ = 0;
  std::atomic<std::size_t> next_ = 0;
  std::vector<std::jthread> workers_;  // the last member: they join before the others go
};

}  // namespace

std::vector<CaseResult> run_suite(const std::vector<PreparedCase>& cases, const fs::path& folder,
                                  const SuiteSettings& settings,
                                  const std::function<void(const CaseResult&, std::size_t ended)>& finished) {
  Crew crew(cases, folder, settings);
  std::vector<CaseResult> results;
  results.reserve(cases.size());
  for (std::size_t i = 0; i < cases.size(); ++i) {
    std::size_t ended = 0;
    results.push_back(crew.result_of(i, ended));
    finished(results.back(), ended);
    results.back().timing.reset();
  }
  return results;
}

}  // namespace drivebench::command
