#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>

#include "protocols/timing/time_histogram.hpp"

namespace drivebench {

/// When the commands of a controller came, by the clock of the bench. They are times of a machine: equal runs
/// have different ones, so that no recording and no report of checks has them.
struct AnswerTimes {
  /// From the departure of a sample to the arrival of the command that answers it.
  TimeHistogram after_sample{};
  /// From the time at which the tick of the sample was due to that arrival; only in real time.
  TimeHistogram after_tick{};
  /// Commands that came after the end of the tick that they answer; only in real time.
  std::uint64_t late = 0;
};

/// {"after_sample": {...}, "after_tick": {...}, "late": 0}, where each histogram has its `bins` as [duration
/// in ns, count] and `worst_ns`.
nlohmann::json answer_times_json(const AnswerTimes& times);
/// Throws nlohmann::json::exception for anything else.
AnswerTimes answer_times_of(const nlohmann::json& object);

}  // namespace drivebench
