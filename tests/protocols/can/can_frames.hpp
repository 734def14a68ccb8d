#pragma once

#include <cstdint>
#include <random>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

inline const Frame kShort{.id = 0x123, .size = 3, .data = {1, 2, 3}};
inline const Frame kRemote{.id = 0x18DAF110, .extended = true, .remote = true, .size = 4};
inline const Frame kFd{.id = 0x7FF,
                       .fd = true,
                       .bit_rate_switch = true,
                       .error_state = true,
                       .size = 12,
                       .data = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}};

/// A frame of any kind that a bus can carry.
inline Frame any_frame(std::mt19937& random) {
  Frame frame;
  frame.extended = random() % 2 == 0;
  frame.id = static_cast<std::uint32_t>(random()) & (frame.extended ? kMaxExtendedId : kMaxStandardId);
  frame.fd = random() % 2 == 0;
  frame.remote = !frame.fd && random() % 4 == 0;
  frame.bit_rate_switch = frame.fd && random() % 2 == 0;
  do {
    frame.size = static_cast<std::uint8_t>(random() % (frame.fd ? 65 : 9));
  } while (!is_fd_size(frame.size));
  for (std::size_t i = 0; i < frame.size && !frame.remote; ++i)
    frame.data[i] = static_cast<std::uint8_t>(random());
  return frame;
}

}  // namespace drivebench::can
