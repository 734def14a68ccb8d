#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "bench.pb.h"
#include "protocols/signals/sample.hpp"

namespace drivebench::simulator {

/// The last samples of an axis, with which the samples that clients get are compared.
class History {
 public:
  void add(const Sample& s) { ring_[s.tick % kSize] = s; }
  /// Whether it equals the sample of its tick; true of ticks before the history. A status has the owner, the
  /// state and the latched faults of now, which in lockstep may be newer than the sample.
  bool agrees(const v1::Sample& told, bool in_status) const;

 private:
  static constexpr std::size_t kSize = 4096;
  std::vector<Sample> ring_ =
      std::vector<Sample>(kSize, Sample{.tick = std::numeric_limits<std::uint64_t>::max()});
};

}  // namespace drivebench::simulator
