#pragma once

#include <linux/can.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "protocols/can/frame.hpp"

/// Converts frames and filters to and from the structs of Linux.
namespace drivebench::can {

/// Converts a frame from the kernel. The id of an error frame holds the class bits of linux/can/error.h.
inline Frame frame_of(const canfd_frame& raw, bool fd) {
  Frame frame;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.extended = !frame.error && (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = !frame.error && (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.id = raw.can_id & (frame.extended || frame.error ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = fd;
  frame.bit_rate_switch = fd && (raw.flags & CANFD_BRS) != 0;
  frame.error_state = fd && (raw.flags & CANFD_ESI) != 0;
  frame.size = raw.len;
  if (!frame.remote) std::copy_n(raw.data, raw.len, frame.data.begin());
  return frame;
}

/// Converts a frame for the kernel.
inline canfd_frame raw_of(const Frame& frame) {
  canfd_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0) | (frame.remote ? CAN_RTR_FLAG : 0);
  raw.len = frame.size;
  if (frame.fd) {
    raw.flags = static_cast<std::uint8_t>((frame.bit_rate_switch ? CANFD_BRS : 0) |
                                          (frame.error_state ? CANFD_ESI : 0));
  }
  std::copy_n(frame.data.begin(), std::min<std::size_t>(frame.size, sizeof raw.data), raw.data);
  return raw;
}

/// Filters that pass exactly these identifiers, in data and remote frames with 11 or 29 bits. Neighbouring
/// identifiers share a filter, because the kernel takes at most 512.
inline std::vector<can_filter> filters_for(std::vector<std::uint32_t> ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  std::vector<can_filter> filters;
  for (const std::uint32_t id : ids) {
    can_filter next{.can_id = id, .can_mask = CAN_EFF_MASK};
    // Like the carry of a counter: two filters of equal size merge into one of twice the size.
    while (!filters.empty() && filters.back().can_mask == next.can_mask) {
      const std::uint32_t bit = next.can_mask & ~(next.can_mask - 1);
      if (filters.back().can_id != (next.can_id ^ bit)) break;
      next = {.can_id = filters.back().can_id, .can_mask = next.can_mask ^ bit};
      filters.pop_back();
    }
    filters.push_back(next);
  }
  return filters;
}

}  // namespace drivebench::can
