#pragma once

#include "protocols/can/codec.hpp"

namespace drivebench::can {

/// Reads edge `index` < kEdgesPerFrame of a message `edges`.
inline Edge edge_at(const Frame& frame, std::size_t index) noexcept {
  const std::uint8_t* const bytes = &frame.data[kFirstEdgeByte + 2 * index];
  return {static_cast<std::uint16_t>(bytes[0] | (bytes[1] & 0x7F) << 8), bytes[1] >> 7 != 0};
}

}  // namespace drivebench::can
