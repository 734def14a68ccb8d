#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace drivebench {

/// The signals of an axis at one tick, as they are published, recorded and sent: a member for each row of
/// signals.inc, by its name.
struct Sample {
#define DRIVEBENCH_UNSIGNED(kind, name, unit, maximum, meaning) std::uint64_t name = 0;
#define DRIVEBENCH_SIGNED(kind, name, unit, first, minimum, maximum, meaning) std::int64_t name = first;
#define DRIVEBENCH_REAL(kind, name, unit, minimum, maximum, meaning) double name = 0.0;
#include "protocols/signals/signals.inc"
};

inline constexpr std::size_t kSampleWords = sizeof(Sample) / 8;
/// The last of them came when runs had been recorded, in these groups: from terminal_a_v on, from
/// comparator_levels on, from i_a_counts on. Hashes pass over the groups while they are zero.
inline constexpr std::array<std::size_t, 3> kLaterSampleWords{
    (offsetof(Sample, comparator_levels) - offsetof(Sample, terminal_a_v)) / 8,
    (offsetof(Sample, i_a_counts) - offsetof(Sample, comparator_levels)) / 8,
    kSampleWords - offsetof(Sample, i_a_counts) / 8};

}  // namespace drivebench
