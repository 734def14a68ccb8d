#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/config/config.hpp"

namespace drivebench {

/// The one place where wall time enters a run.
class Pacer {
 public:
  virtual ~Pacer() = default;
  /// Returns when the next tick is due, with how late that is, in nanoseconds; the first call sets time zero.
  virtual std::int64_t wait() noexcept = 0;
  /// Makes the tick that is due now the new time zero.
  virtual void resynchronise() noexcept = 0;
};

/// Absolute deadlines on CLOCK_MONOTONIC. `sleep` trusts the kernel's timer; `sleep+spin` wakes earlier and
/// polls the clock for the last kSpinNs.
std::unique_ptr<Pacer> make_realtime_pacer(PacerKind kind, std::int64_t period_ns);

/// As fast as possible.
std::unique_ptr<Pacer> make_free_pacer();

/// Counts latenesses: bucket n holds those below 125 ns times 2^n (and not in a bucket before it), the last
/// one the rest.
class LatenessHistogram {
 public:
  static constexpr std::int64_t kFirstEdgeNs = 125;
  static constexpr std::size_t kBuckets = 32;

  void add(std::int64_t lateness_ns) noexcept;
  std::uint64_t count() const noexcept { return count_; }
  std::int64_t worst_ns() const noexcept { return worst_ns_; }
  const std::array<std::uint64_t, kBuckets>& buckets() const noexcept { return buckets_; }
  /// Upper edge of the bucket in which this share (0..1) of all entries is reached.
  std::int64_t percentile_ns(double share) const noexcept;

 private:
  std::array<std::uint64_t, kBuckets> buckets_{};
  std::uint64_t count_ = 0;
  std::int64_t worst_ns_ = 0;
};

/// What the machine granted to the thread that asked for real-time treatment, as sentences for people; empty:
/// all.
std::vector<std::string> enter_realtime(const RealtimeConfig& config);

}  // namespace drivebench
