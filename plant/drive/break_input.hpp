#pragma once

#include <cstdint>
#include <limits>

namespace drivebench {

/// What the break input of the timer remembers: that the legs open, and when. 8-byte members only.
struct BreakMemory {
  std::uint64_t pending = 0;  ///< 1: a current or the fault line has been beyond its limit
  double due_s = 0.0;         ///< when the legs open, from the start of the tick that is running

  double opens_s() const noexcept { return pending != 0 ? due_s : std::numeric_limits<double>::infinity(); }
};

}  // namespace drivebench
