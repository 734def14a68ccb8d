#pragma once

#include <cstdint>
#include <string>

#include "server/config/config.hpp"
#include "server/pacing/pacer.hpp"

namespace drivebench {

/// How a run went; printed at its end and stored as the last message of its recording.
struct Verdict {
  RunMode mode = RunMode::kLockstep;
  std::uint64_t ticks = 0;
  std::uint64_t late_ticks = 0;
  LatenessHistogram lateness{};  ///< empty outside real time
  std::uint64_t gaps = 0;        ///< entries that the recorder lost
  std::uint64_t state_hash = 0;

  /// Every sample follows from the recorded inputs alone, and the recording has them all.
  bool exact() const noexcept { return gaps == 0; }
  /// Plant time was wall time: no tick started after its period was over.
  bool realtime_valid() const noexcept { return mode == RunMode::kRealtime && late_ticks == 0; }
  /// The verdict as one sentence for people.
  std::string sentence() const;
};

}  // namespace drivebench
