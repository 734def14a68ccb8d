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
/// The last of them came when runs had been recorded, in groups that begin with these words: at terminal_a_v,
/// comparator_levels, i_a_counts and absolute_angle. Hashes pass over a group while it is zero.
inline constexpr std::array<std::size_t, 4> kLaterSampleGroups{
    offsetof(Sample, terminal_a_v) / 8, offsetof(Sample, comparator_levels) / 8,
    offsetof(Sample, i_a_counts) / 8, offsetof(Sample, absolute_angle) / 8};

}  // namespace drivebench
