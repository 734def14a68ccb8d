#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/bench/bench.hpp"

namespace drivebench {

/// The first place where a recording and its re-simulation differ.
struct ReplayDifference {
  std::uint64_t tick = 0;
  std::string axis;
  std::string signal;
  std::string recorded;
  std::string replayed;
};

/// The result of a replay.
struct ReplayReport {
  enum class Result {
    kEqual,            ///< every sample and the state hash are equal, bit for bit
    kEqualWithoutEnd,  ///< every sample is equal; the recording ends before its run did, or before its own
                       ///< end
    kDifferent,        ///< see difference and problem
    kUnusable,         ///< not a recording of a run, damaged, or one that lost entries: see problem
  };
  Result result = Result::kUnusable;
  std::uint64_t ticks = 0;  ///< without an end: up to the last one that has all its samples
  std::uint64_t samples = 0;
  std::uint64_t inputs = 0;
  std::uint64_t state_hash = 0;
  std::string recorded_by;                    ///< program and build
  std::optional<std::int64_t> begun_unix_ns;  ///< UTC since 1970 of tick 0; only of a recording in real time
  bool same_build = true;  ///< this build made the recording; another build may give other bits
  std::optional<ReplayDifference> difference;
  std::string problem;  ///< a sentence; empty: none
};

/// Builds the bench from the configuration in the recording, gives it the recorded inputs at their ticks and
/// compares every sample. Calls `on_progress` repeatedly with the finished share, 0 to 1.
ReplayReport replay(std::span<const std::byte> recording, void (*on_progress)(double));
/// Replays a recording in several files.
ReplayReport replay(const std::vector<std::span<const std::byte>>& segments, void (*on_progress)(double));

/// How much of a recording a bench repeats.
struct Repetition {
  Tick until;                         ///< 0: only the first samples are compared
  std::function<void()> before_tick;  ///< called before each tick
};

/// Gives a bench at tick 0 the inputs of a recording up to a tick, and compares every sample. The bench has
/// the setup of the recorded one, had no input, and awaits the events of its configuration: their conditions
/// are watched meanwhile. Throws std::runtime_error with the reason for which it is not where the recorded
/// one was.
void repeat(const std::vector<std::span<const std::byte>>& segments, Bench& bench, const Repetition& what);

}  // namespace drivebench
