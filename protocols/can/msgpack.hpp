#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// What python-can's virtual bus "udp_multicast" sends: one MessagePack map per datagram, whose keys are the
/// attributes of its Message.

/// No frame takes more bytes.
inline constexpr std::size_t kMaxMsgpackFrame = 256;

/// Writes the frame, with the time of its sending in seconds since 1970, byte for byte as python-can does
/// (its receivers use their own time instead). Returns the number of bytes, or 0 if `out` is shorter than
/// kMaxMsgpackFrame.
std::size_t encode_msgpack(const Frame& frame, double timestamp_s, std::span<std::byte> out) noexcept;

/// Reads a frame. Keys may come in any order; unknown ones are passed over, and those that are missing are
/// what python-can takes them for (an identifier is extended unless it says otherwise). Nothing if it is not
/// one whole map, or if no bus can carry such a frame.
std::optional<Frame> decode_msgpack(std::span<const std::byte> in) noexcept;

}  // namespace drivebench::can
