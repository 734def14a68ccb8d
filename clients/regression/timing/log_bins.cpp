#include "clients/regression/timing/log_bins.hpp"

#include <bit>

namespace drivebench::regression {
namespace {

/// The empty bin of a duration.
LogBin empty_bin_of(std::int64_t duration_ns) noexcept {
  if (duration_ns < 8) return {.from_ns = duration_ns, .to_ns = duration_ns + 1, .count = 0};
  const int shift = static_cast<int>(std::bit_width(static_cast<std::uint64_t>(duration_ns))) - 4;
  const std::int64_t eighth = duration_ns >> shift;
  return {.from_ns = eighth << shift, .to_ns = (eighth + 1) << shift, .count = 0};
}

}  // namespace

std::vector<LogBin> log_bins(const TimeHistogram& histogram) {
  std::vector<LogBin> bins;
  histogram.each_bin([&bins](std::int64_t lower_ns, std::int64_t, std::uint64_t count) {
    if (bins.empty()) bins.push_back(empty_bin_of(lower_ns));
    while (bins.back().to_ns <= lower_ns)
      bins.push_back(empty_bin_of(bins.back().to_ns));
    bins.back().count += count;
  });
  return bins;
}

}  // namespace drivebench::regression
