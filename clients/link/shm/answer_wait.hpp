#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>

namespace drivebench::link {

/// How this side waits for an answer in shared memory.
struct AnswerWait {
  enum class End { kAnswered, kTooLate, kSessionOver };

  std::chrono::microseconds spin;  ///< it looks for so long before it sleeps
  int socket;                      ///< of the session, whose end it shows

  /// Until the bench's number is `number`. `waits` is this side's word for "asleep". Without a deadline it
  /// waits for ever, or for the end of the session.
  End await(const std::atomic<std::uint32_t>& bench, std::uint32_t number, std::atomic<std::uint32_t>& waits,
            bool may_spin, std::optional<std::chrono::milliseconds> deadline) const;
};

}  // namespace drivebench::link
