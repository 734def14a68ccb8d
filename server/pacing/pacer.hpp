#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/config/config.hpp"

namespace drivebench {

/// Paces the ticks of a run; the only place where wall time enters a run.
class Pacer {
 public:
  virtual ~Pacer() = default;
  /// Waits until the next tick is due and returns the lateness [ns]; the first call sets time zero.
  virtual std::int64_t wait() noexcept = 0;
  /// Makes the time of the due tick the new time zero.
  virtual void resynchronise() noexcept = 0;
  /// The time on CLOCK_MONOTONIC at which the tick of the last wait() was due [ns]; 0 without a clock.
  virtual std::int64_t due_ns() const noexcept { return 0; }
  /// The same moment in UTC since 1970 [ns], by the wall clock when time zero was set; 0 without a clock.
  virtual std::int64_t due_unix_ns() const noexcept { return 0; }
};

/// A pacer with absolute deadlines on CLOCK_MONOTONIC. `sleep` relies on the kernel's timer; `sleep+spin`
/// wakes earlier and polls the clock for the last 30 us.
std::unique_ptr<Pacer> make_realtime_pacer(PacerKind kind, std::int64_t period_ns);

/// A pacer that never waits.
std::unique_ptr<Pacer> make_free_pacer();

/// Counts latenesses: bucket n holds those below 125 ns times 2^n that no earlier bucket holds; the last
/// bucket holds the rest.
class LatenessHistogram {
 public:
  static constexpr std::int64_t kFirstEdgeNs = 125;
  static constexpr std::size_t kBuckets = 32;

  void add(std::int64_t lateness_ns) noexcept;
  std::uint64_t count() const noexcept { return count_; }
  std::int64_t worst_ns() const noexcept { return worst_ns_; }
  const std::array<std::uint64_t, kBuckets>& buckets() const noexcept { return buckets_; }
  /// The upper edge of the bucket in which this share (0..1) of all entries is reached.
  std::int64_t percentile_ns(double share) const noexcept;

 private:
  std::array<std::uint64_t, kBuckets> buckets_{};
  std::uint64_t count_ = 0;
  std::int64_t worst_ns_ = 0;
};

/// Asks for real-time scheduling, CPU and locked memory for this thread. Returns a sentence for each refusal
/// of the system.
std::vector<std::string> enter_realtime(const RealtimeConfig& config);

}  // namespace drivebench
