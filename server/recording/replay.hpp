#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace drivebench {

/// The first place where a recording and its re-simulation differ.
struct ReplayDifference {
  std::uint64_t tick = 0;
  std::string axis;
  std::string signal;
  std::string recorded;
  std::string replayed;
};

/// What re-simulating a recording gave.
struct ReplayReport {
  enum class Result {
    kEqual,      ///< every sample and the state hash are equal, bit for bit
    kDifferent,  ///< see difference and problem
    kUnusable,   ///< not a recording of a run, or one that lost entries: see problem
  };
  Result result = Result::kUnusable;
  std::uint64_t ticks = 0;
  std::uint64_t samples = 0;
  std::uint64_t inputs = 0;
  std::uint64_t state_hash = 0;
  std::string recorded_by;  ///< program and build
  bool same_build = true;   ///< as this one; else bits may differ though nothing is wrong
  std::optional<ReplayDifference> difference;
  std::string problem;  ///< a sentence; empty if there is none
};

/// Builds the bench from the configuration in the recording, feeds it the recorded inputs at their ticks and
/// compares every sample. `on_progress` is called now and then with the share done, 0 to 1.
ReplayReport replay(std::span<const std::byte> recording, void (*on_progress)(double));
/// The same for a recording in several files.
ReplayReport replay(const std::vector<std::span<const std::byte>>& segments, void (*on_progress)(double));

}  // namespace drivebench
