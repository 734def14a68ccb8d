#pragma once

#include <cstdint>
#include <string>

#include "server/config/config.hpp"
#include "server/host/octave_histogram.hpp"

namespace drivebench {

/// The result of a run; printed at its end and stored as the last message of its recording.
struct Verdict {
  RunMode mode = RunMode::kLockstep;
  std::uint64_t ticks = 0;
  std::uint64_t late_ticks = 0;
  OctaveHistogram lateness{};  ///< empty outside real time
  std::uint64_t gaps = 0;      ///< entries that the recorder lost
  std::uint64_t state_hash = 0;
  std::string recording{};  ///< its first file that is there; empty: none
  std::string remarks{};    ///< damage that disks and other programs have done to its files

  /// Whether every sample follows from the recorded inputs alone, and the recording has all of them.
  bool exact() const noexcept { return gaps == 0; }
  /// Whether plant time was wall time: no tick started after the end of its period.
  bool realtime_valid() const noexcept { return mode == RunMode::kRealtime && late_ticks == 0; }
  /// The verdict as a sentence.
  std::string sentence() const;
};

}  // namespace drivebench
