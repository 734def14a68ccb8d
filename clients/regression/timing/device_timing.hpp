#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string_view>

#include "clients/regression/timing/missed_effect.hpp"
#include "protocols/signals/sample.hpp"
#include "protocols/timing/answer_times.hpp"

namespace drivebench::regression {

/// Ticks for which the device under test owed a command and sent none. They follow from the samples alone.
struct MissedTicks {
  std::uint64_t all = 0;
  std::uint64_t longest_burst = 0;  ///< in a row

  /// The samples of its axis, one for each tick.
  void see(const Sample& sample) noexcept {
    const std::uint64_t missed = sample.missed_commands - std::min(before_, sample.missed_commands);
    before_ = sample.missed_commands;
    burst_ = missed == 0 ? 0 : burst_ + missed;
    all += missed;
    longest_burst = std::max(longest_burst, burst_);
  }
  void add(const MissedTicks& other) noexcept {
    all += other.all;
    longest_burst = std::max(longest_burst, other.longest_burst);
  }

 private:
  std::uint64_t before_ = 0;
  std::uint64_t burst_ = 0;
};

/// How fast the device under test answered in a run, on the machine of that run.
struct DeviceTiming {
  /// What the time from sample to command holds.
  enum class Way {
    kInProcess,  ///< the computing time of a preset
    kLockstep,   ///< the computing time of a program and its link, both ways
    kRealtime    ///< the same while time goes on
  };
  Way way = Way::kInProcess;
  std::int64_t period_ns = 0;  ///< of the bench
  AnswerTimes answers{};
  MissedTicks missed{};
  std::optional<MissedEffect> effect{};  ///< in real time, if answers were late or missed
};

/// "in process", "lockstep" or "real time".
std::string_view word_of(DeviceTiming::Way way) noexcept;

}  // namespace drivebench::regression
