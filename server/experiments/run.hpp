#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "server/experiments/plan.hpp"
#include "server/pacing/verdict.hpp"
#include "server/recording/recording_file.hpp"

namespace drivebench {

/// The progress of a run, for other threads.
struct RunProgress {
  std::atomic<std::uint64_t> tick{0};
  std::atomic<std::uint64_t> rows{0};  ///< in the data file
  std::atomic<bool> cancel{false};     ///< set by another thread to end the run
};

struct RunFiles {
  std::filesystem::path recording;
  std::filesystem::path rows;
  CreateRecordingFile create_recording{};  ///< empty: create_recording_file
};

struct RunOutcome {
  v1::ExperimentState state = v1::EXPERIMENT_STATE_COMPLETED;
  std::string reason;  ///< a sentence; empty: the run was complete
  Verdict verdict;
};

/// Runs an experiment on a bench of its own, on the calling thread, into two new files; attaches the request
/// to the recording. Calls `published` after new rows. Throws std::system_error if a file cannot be created
/// or less than kDiskReserveBytes is free.
RunOutcome run_experiment(const ExperimentPlan& plan, const RunFiles& files, const std::string& request,
                          RunProgress& progress, const std::function<void()>& published);

}  // namespace drivebench
