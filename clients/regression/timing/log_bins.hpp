#pragma once

#include <cstdint>
#include <vector>

#include "protocols/timing/time_histogram.hpp"

namespace drivebench::regression {

/// Durations from one edge up to the next.
struct LogBin {
  std::int64_t from_ns;
  std::int64_t to_ns;
  std::uint64_t count;
};

/// A histogram with eight bins to an octave, from the first to the last that is not empty.
std::vector<LogBin> log_bins(const TimeHistogram& histogram);

}  // namespace drivebench::regression
