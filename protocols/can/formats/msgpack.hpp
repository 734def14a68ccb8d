#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// The datagrams of python-can's virtual bus "udp_multicast": each is one MessagePack map whose keys are the
/// attributes of python-can's Message.

/// The size limit of an encoded frame [bytes].
inline constexpr std::size_t kMaxMsgpackFrame = 256;

/// Encodes the frame with its time of sending [s since 1970], byte for byte as python-can does. Returns the
/// number of bytes, or 0 if `out` is shorter than kMaxMsgpackFrame.
std::size_t encode_msgpack(const Frame& frame, double timestamp_s, std::span<std::byte> out) noexcept;

/// Decodes a frame. Keys may come in any order; unknown keys are skipped, and missing ones get the defaults
/// of python-can (an identifier is extended). Nothing if the bytes are not one whole map, or if no bus can
/// carry the frame.
std::optional<Frame> decode_msgpack(std::span<const std::byte> in) noexcept;

}  // namespace drivebench::can
