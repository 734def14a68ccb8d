#include "protocols/timing/time_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace drivebench {

void TimeHistogram::add(std::int64_t duration_ns, std::uint64_t times) noexcept {
  if (times == 0) return;
  const std::int64_t ns = std::clamp<std::int64_t>(duration_ns, 0, (std::int64_t{1} << kMostBits) - 1);
  bins_[bin_of(static_cast<std::uint64_t>(ns))] += times;
  smallest_ns_ = count_ == 0 ? ns : std::min(smallest_ns_, ns);
  worst_ns_ = std::max(worst_ns_, ns);
  count_ += times;
}

void TimeHistogram::add(const TimeHistogram& other) noexcept {
  if (other.count_ == 0) return;
  for (std::size_t bin = 0; bin < kBins; ++bin)
    bins_[bin] += other.bins_[bin];
  smallest_ns_ = count_ == 0 ? other.smallest_ns_ : std::min(smallest_ns_, other.smallest_ns_);
  worst_ns_ = std::max(worst_ns_, other.worst_ns_);
  count_ += other.count_;
}

double TimeHistogram::percentile_ns(double share) const noexcept {
  const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
  std::uint64_t seen = 0;
  for (std::size_t bin = 0; bin < kBins && count_ != 0; ++bin) {
    seen += bins_[bin];
    if (seen < std::max<std::uint64_t>(wanted, 1)) continue;
    const double middle_ns = 0.5 * static_cast<double>(lower_edge_ns(bin) + lower_edge_ns(bin + 1) - 1);
    return std::clamp(middle_ns, static_cast<double>(smallest_ns_), static_cast<double>(worst_ns_));
  }
  return 0.0;
}

double TimeHistogram::jitter_rms_ns() const noexcept {
  if (count_ == 0) return 0.0;
  const double median_ns = percentile_ns(0.5);
  double sum = 0.0;
  each_bin([&](std::int64_t lower_ns, std::int64_t upper_ns, std::uint64_t times) {
    const double deviation_ns = 0.5 * static_cast<double>(lower_ns + upper_ns - 1) - median_ns;
    sum += static_cast<double>(times) * deviation_ns * deviation_ns;
  });
  return std::sqrt(sum / static_cast<double>(count_));
}

double TimeHistogram::jitter_peak_ns() const noexcept {
  const double median_ns = percentile_ns(0.5);
  return std::max(static_cast<double>(worst_ns()) - median_ns,
                  median_ns - static_cast<double>(smallest_ns()));
}

}  // namespace drivebench
