#include "clients/command/regression/suite_run.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "clients/command/regression/run_case.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using regression::CaseResult;

/// Workers take the next case from a counter, and put its result in its place.
class Crew {
 public:
  Crew(const std::vector<PreparedCase>& cases, const fs::path& folder, unsigned jobs, bool keeps_traces)
      : cases_(cases), folder_(folder), keeps_traces_(keeps_traces), results_(cases.size()) {
    const std::size_t workers = std::min<std::size_t>(std::max(1U, jobs), cases.size());
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
      fs::create_directory(folder);
      CaseResult result = run_case(cases_[index], folder, keeps_traces_);
      std::error_code ignored;
      fs::remove_all(folder, ignored);
      const std::lock_guard lock(mutex_);
      results_[index] = std::move(result);
      ++ended_;
      ready_.notify_one();
    }
  }

  const std::vector<PreparedCase>& cases_;
  fs::path folder_;
  bool keeps_traces_;
  std::mutex mutex_;
  std::condition_variable ready_;
  std::vector<std::optional<CaseResult>> results_;
  std::size_t ended_ = 0;
  std::atomic<std::size_t> next_ = 0;
  std::vector<std::jthread> workers_;  // the last member: they join before the others go
};

}  // namespace

std::vector<CaseResult> run_suite(const std::vector<PreparedCase>& cases, const fs::path& folder,
                                  unsigned jobs, bool keeps_traces,
                                  const std::function<void(const CaseResult&, std::size_t ended)>& finished) {
  Crew crew(cases, folder, jobs, keeps_traces);
  std::vector<CaseResult> results;
  results.reserve(cases.size());
  for (std::size_t i = 0; i < cases.size(); ++i) {
    std::size_t ended = 0;
    results.push_back(crew.result_of(i, ended));
    finished(results.back(), ended);
  }
  return results;
}

}  // namespace drivebench::command
