#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/bench/bench.hpp"

namespace drivebench {

/// The newest samples of an axis, or every n-th of them, kept once for all who subscribe to them.
class SampleFeed {
 public:
  /// Samples that wait for a reader: of more he loses the oldest.
  static constexpr std::size_t kDepth = 256;

  /// Where a reader stands, and how many samples he has lost that nobody has told him of.
  struct Reader {
    std::uint64_t next;
    std::uint64_t skipped;
    std::uint64_t dropped;
  };

  /// Samples whose tick is a multiple of `decimation`, 1 or more, after the tick `now`.
  SampleFeed(std::uint32_t axis, std::uint32_t decimation, std::uint64_t now)
      : axis_(axis), decimation_(decimation), last_tick_(now), ring_(kDepth) {}

  std::uint32_t axis() const noexcept { return axis_; }
  std::uint32_t decimation() const noexcept { return decimation_; }

  /// After each tick.
  void take(const Sample& newest);
  /// A reader of what comes from now on.
  Reader reader() const noexcept { return {.next = taken_, .skipped = skipped_, .dropped = 0}; }
  /// The next samples for the reader, those that lie in one piece and `at_most` of them; empty if he has all.
  std::span<const Sample> read(Reader& reader, std::size_t at_most) const;

 private:
  std::uint32_t axis_;
  std::uint32_t decimation_;
  std::uint64_t last_tick_;  // seen
  std::uint64_t taken_ = 0;
  std::uint64_t skipped_ = 0;  // samples of ticks that were over before this thread saw them
  std::vector<Sample> ring_;   // sample n at n modulo kDepth
};

}  // namespace drivebench
