#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "bench.pb.h"
#include "protocols/signals/sample.hpp"

namespace drivebench::simulator {

/// The last samples of an axis, against which those are held that clients are told.
class History {
 public:
  void add(const Sample& s) { ring_[s.tick % kSize] = s; }
  /// Whether it says what there was at its tick; true of ticks that nobody remembers. A status names the
  /// owner of now, who in lockstep may have come since.
  bool agrees(const v1::Sample& told, bool in_status) const;

 private:
  static constexpr std::size_t kSize = 4096;
  std::vector<Sample> ring_ =
      std::vector<Sample>(kSize, Sample{.tick = std::numeric_limits<std::uint64_t>::max()});
};

}  // namespace drivebench::simulator
