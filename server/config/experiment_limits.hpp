#pragma once

#include <cstddef>
#include <cstdint>

#include "protocols/framing.hpp"

namespace drivebench {

/// Limits that let the list of all experiments fit into one answer.
inline constexpr std::uint32_t kMaxQueuedExperiments = 100;
inline constexpr std::uint32_t kMaxKeptExperiments = 300;
inline constexpr std::size_t kMaxExperimentInfoBytes = 2048;
inline constexpr std::size_t kMaxExperimentReasonBytes = 300;

/// The largest number of an experiment. No folder comes near it; a file with a larger one is left alone.
inline constexpr std::uint64_t kMaxExperimentId = 1'000'000'000'000;

// 16 bytes for tag, length and queue position of each entry; 64 for the envelope.
static_assert((kMaxQueuedExperiments + 1 + kMaxKeptExperiments) * (kMaxExperimentInfoBytes + 16) + 64 <=
              kMaxReplyFrame);

}  // namespace drivebench
