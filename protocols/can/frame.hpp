#pragma once

#include <algorithm>
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

/// Sizes of FD frames by length code.
inline constexpr std::array<std::uint8_t, 16> kFdSizes{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

constexpr bool is_fd_size(std::size_t size) noexcept {
  return std::ranges::find(kFdSizes, size) != kFdSizes.end();
}

}  // namespace drivebench::can
