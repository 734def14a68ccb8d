#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/bench/bench.hpp"

namespace drivebench {

/// The newest samples of an axis, or every n-th of them, kept once for all subscriptions to them.
class SampleFeed {
 public:
  /// The most samples that wait for a reader; then it loses the oldest.
  static constexpr std::size_t kDepth = 256;

  /// Position of a reader in the feed.
  struct Reader {
    std::uint64_t next;     ///< number of the sample that it reads next
    std::uint64_t skipped;  ///< the feed's count of skipped samples at its last read
    std::uint64_t dropped;  ///< lost samples of which the reader does not know yet
  };

  /// Samples whose tick is a multiple of `decimation`, 1 or more, after the tick `now`.
  SampleFeed(std::uint32_t axis, std::uint32_t decimation, std::uint64_t now)
      : axis_(axis), decimation_(decimation), last_tick_(now), ring_(kDepth) {}

  std::uint32_t axis() const noexcept { return axis_; }
  std::uint32_t decimation() const noexcept { return decimation_; }

  /// Called after each tick.
  void take(const Sample& newest);
  /// The bench has gone to another state, whose sample this is; no sample counts as lost.
  void begin_anew(const Sample& first);
  /// A new reader, for the samples from now on.
  Reader reader() const noexcept { return {.next = taken_, .skipped = skipped_, .dropped = 0}; }
  /// The next samples for the reader: as many as lie in one piece, and at most `at_most`. Empty if it has
  /// read all.
  std::span<const Sample> read(Reader& reader, std::size_t at_most) const;

 private:
  std::uint32_t axis_;
  std::uint32_t decimation_;
  std::uint64_t last_tick_;  // the newest
  std::uint64_t taken_ = 0;
  std::uint64_t skipped_ = 0;  // samples of ticks that did not reach this thread
  std::vector<Sample> ring_;   // sample n at n modulo kDepth
};

}  // namespace drivebench
