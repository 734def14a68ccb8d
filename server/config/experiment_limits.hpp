#pragma once

#include <cstddef>
#include <cstdint>

#include "protocols/framing.hpp"

namespace drivebench {

/// The list of all experiments is one answer: so many may wait and be kept, and so much there is to tell of
/// each.
inline constexpr std::uint32_t kMaxQueuedExperiments = 100;
inline constexpr std::uint32_t kMaxKeptExperiments = 300;
inline constexpr std::size_t kMaxExperimentInfoBytes = 2048;
inline constexpr std::size_t kMaxExperimentReasonBytes = 300;

// Beside each its tag, its length and its place in the queue; beside all the id of the request.
static_assert((kMaxQueuedExperiments + 1 + kMaxKeptExperiments) * (kMaxExperimentInfoBytes + 16) + 64 <=
              kMaxReplyFrame);

}  // namespace drivebench
