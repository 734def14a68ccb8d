#pragma once

#include <bench.pb.h>

namespace drivebench::link {

/// The word of bench files for a mode.
inline const char* name_of(v1::Mode mode) noexcept {
  switch (mode) {
    case v1::MODE_REALTIME:
      return "realtime";
    case v1::MODE_LOCKSTEP:
      return "lockstep";
    case v1::MODE_FREE:
      return "free";
    default:
      return "unknown";
  }
}

}  // namespace drivebench::link
