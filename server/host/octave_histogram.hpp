#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace drivebench {

/// Counts times by octaves, such as the latenesses of ticks: bucket n holds those below 125 ns times 2^n that
/// no earlier bucket holds; the last bucket holds the rest.
class OctaveHistogram {
 public:
  static constexpr std::int64_t kFirstEdgeNs = 125;
  static constexpr std::size_t kBuckets = 32;
  using Buckets = std::array<std::uint64_t, kBuckets>;

  /// Returns the number of the bucket.
  std::size_t add(std::int64_t time_ns) noexcept;
  std::uint64_t count() const noexcept { return count_; }
  std::int64_t worst_ns() const noexcept { return worst_ns_; }
  std::uint64_t sum_ns() const noexcept { return sum_ns_; }
  const Buckets& buckets() const noexcept { return buckets_; }
  /// The upper edge of the bucket in which this share (0..1) of all entries is reached.
  std::int64_t percentile_ns(double share) const noexcept;

 private:
  Buckets buckets_{};
  std::uint64_t count_ = 0;
  std::uint64_t sum_ns_ = 0;
  std::int64_t worst_ns_ = 0;
};

/// A histogram to which one thread adds and at which others look meanwhile, without a lock.
class SharedOctaveHistogram {
 public:
  /// What another thread sees. An entry that is being added may be in one of the members and not yet in
  /// another.
  struct View {
    OctaveHistogram::Buckets buckets{};
    std::uint64_t sum_ns = 0;
    std::int64_t worst_ns = 0;
  };

  void add(std::int64_t time_ns) noexcept;
  /// For the thread that adds.
  const OctaveHistogram& own() const noexcept { return own_; }
  /// For every thread.
  View view() const noexcept;
  std::int64_t worst_ns() const noexcept { return worst_ns_.load(std::memory_order_relaxed); }

 private:
  OctaveHistogram own_;
  std::array<std::atomic<std::uint64_t>, OctaveHistogram::kBuckets> buckets_{};
  std::atomic<std::uint64_t> sum_ns_{0};
  std::atomic<std::int64_t> worst_ns_{0};
};

}  // namespace drivebench
