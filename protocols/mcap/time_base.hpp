#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocols/mcap/mcap.hpp"

/// The wall clock of a recording made in real time: a metadata record, from which its log times become UTC.
/// The due times of the ticks follow CLOCK_MONOTONIC, so a wall clock that is set during the run changes
/// nothing. They begin anew after a tick that was later than `max_lateness`; then the wall clock is read
/// again and another record follows, which holds for the samples behind it. Recordings in lockstep and free
/// mode have none: their time is no wall time, and equal runs give equal bytes.
namespace drivebench {

inline constexpr std::string_view kTimeBaseMetadata = "drivebench.time_base";

struct TimeBase {
  std::uint64_t since_tick = 0;    ///< holds for the samples of later ticks, until another time base follows
  std::int64_t epoch_unix_ns = 0;  ///< UTC, since 1970, at which tick 0 began or would have begun [ns]

  /// UTC at which a sample of this log time was due [ns].
  std::int64_t unix_ns(std::uint64_t log_time_ns) const noexcept {
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(epoch_unix_ns) + log_time_ns);
  }
  bool operator==(const TimeBase&) const = default;
};

McapMap entries_of(const TimeBase& base);

/// The time base in force at the reader's place in a file; nothing if none has come yet. Throws
/// std::runtime_error if one of its numbers is none.
std::optional<TimeBase> time_base_at(const McapReader& reader);

/// Date and time of the day as ISO 8601 writes them, to the microsecond: "2026-11-27T15:39:25.123456Z".
std::string utc_text(std::int64_t unix_ns);

}  // namespace drivebench
