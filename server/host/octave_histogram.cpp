#include "server/host/octave_histogram.hpp"

#include <algorithm>

namespace drivebench {

std::size_t OctaveHistogram::add(std::int64_t time_ns) noexcept {
  std::size_t bucket = 0;
  for (std::int64_t edge = kFirstEdgeNs; time_ns >= edge && bucket + 1 < buckets_.size(); edge *= 2)
    ++bucket;
  ++buckets_[bucket];
  ++count_;
  sum_ns_ += static_cast<std::uint64_t>(std::max<std::int64_t>(time_ns, 0));
  worst_ns_ = std::max(worst_ns_, time_ns);
  return bucket;
}

std::int64_t OctaveHistogram::percentile_ns(double share) const noexcept {
  const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(count_));
  std::uint64_t seen = 0;
  std::int64_t edge = kFirstEdgeNs;
  for (const std::uint64_t bucket : buckets_) {
    seen += bucket;
    if (seen > wanted) break;
    edge *= 2;
  }
  return std::min(edge, worst_ns_);
}

void SharedOctaveHistogram::add(std::int64_t time_ns) noexcept {
  const std::size_t bucket = own_.add(time_ns);
  buckets_[bucket].store(own_.buckets()[bucket], std::memory_order_relaxed);
  sum_ns_.store(own_.sum_ns(), std::memory_order_relaxed);
  worst_ns_.store(own_.worst_ns(), std::memory_order_relaxed);
}

SharedOctaveHistogram::View SharedOctaveHistogram::view() const noexcept {
  View seen{.sum_ns = sum_ns_.load(std::memory_order_relaxed), .worst_ns = worst_ns()};
  for (std::size_t n = 0; n < buckets_.size(); ++n)
    seen.buckets[n] = buckets_[n].load(std::memory_order_relaxed);
  return seen;
}

}  // namespace drivebench
