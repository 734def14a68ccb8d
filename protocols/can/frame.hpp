#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace drivebench::can {

/// A frame as every back end sends and receives it.
struct Frame {
  std::uint32_t id = 0;  ///< 11 bits, or 29 if extended
  bool extended = false;
  bool remote = false;  ///< a request without data; classic only
  bool error = false;   ///< an error frame: the CAN controller reports the state of the bus
  bool fd = false;      ///< up to 64 bytes; otherwise up to 8
  bool bit_rate_switch = false;
  bool error_state = false;  ///< FD: the sender is error passive
  std::uint8_t size = 0;     ///< bytes of data (of a remote frame: requested)
  std::array<std::uint8_t, 64> data{};

  bool operator==(const Frame&) const = default;
};

inline constexpr std::uint32_t kMaxStandardId = 0x7FF;
inline constexpr std::uint32_t kMaxExtendedId = 0x1FFFFFFF;

/// Whether a CAN FD frame can have this size.
constexpr bool is_fd_size(std::size_t size) noexcept {
  if (size <= 8) return true;
  for (const std::size_t allowed : {12u, 16u, 20u, 24u, 32u, 48u, 64u}) {
    if (size == allowed) return true;
  }
  return false;
}

}  // namespace drivebench::can
