#pragma once

#include <condition_variable>
#include <cstdint>
#include <list>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <variant>

#include "clients/web/gateway/runs/suite_folder.hpp"
#include "clients/web/gateway/runs/work.hpp"

namespace drivebench::web {

/// A run that cannot be: what() names field, value and rule.
struct RunRefusal : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A run that was asked for, or that will end.
struct RunAnswer {
  std::uint64_t number = 0;
  std::string sentence{};
};

/// The suites and identifications that browsers have asked for, one after the other in a thread of its own.
/// Everything may be called from any thread.
class Runs {
 public:
  static constexpr std::size_t kMostWaiting = 8;
  static constexpr std::size_t kMostKept = 32;  ///< of those that have ended

  /// Without `suites` it runs none. Throws StartError.
  Runs(RunPlaces places, const std::filesystem::path& suites, bool identifies);
  /// Ends the one that runs.
  ~Runs();
  Runs(const Runs&) = delete;
  Runs& operator=(const Runs&) = delete;

  /// Both throw RunRefusal.
  RunAnswer ask(std::string_view suite);
  RunAnswer ask(IdentificationWork work);
  /// Throws RunRefusal if it has ended or never was.
  RunAnswer cancel(std::uint64_t number);

  /// As JSON: {"begun_us": N, "suites": [NAME], "identifies": true, "runs": [{"number", "subject", "state",
  /// "done", "of", "bad", "sentence", "report"}]}, the newest first. Runs of another `begun_us` have other
  /// numbers. The states are `waits`, `runs`, `passed`, `failed` and `cancelled`; `report` is a name in the
  /// folder of reports or empty.
  std::string list() const;

 private:
  using Work = std::variant<SuiteWork, IdentificationWork>;
  enum class State { kWaits, kRuns, kPassed, kFailed, kCancelled };
  struct Run {
    std::uint64_t number = 0;
    std::string subject{};
    Work work{};
    std::stop_source stop{};
    State state = State::kWaits;
    CaseCounts counts{};
    std::string sentence{};
    std::string report{};
    std::uint64_t ended_as = 0;  ///< the how manieth
  };

  RunAnswer add(std::string subject, Work work);
  void run_all(const std::stop_token& stop);
  Run* next_of_those_that_wait();
  WorkEnd carry_out(Run& run);
  void end(Run& run, State state);

  RunPlaces places_;
  std::optional<SuiteFolder> suites_{};
  bool identifies_;
  std::int64_t begun_us_;       ///< Unix time: another gateway numbers its runs anew
  mutable std::mutex mutex_{};  // of what follows
  std::condition_variable_any changed_{};
  std::uint64_t last_number_ = 0;
  std::uint64_t last_ended_ = 0;
  std::list<Run> runs_{};  // by their numbers
  std::jthread worker_;    // the last member: it ends before the others go
};

}  // namespace drivebench::web
