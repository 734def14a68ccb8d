#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace drivebench {

/// A frame on a stream is a 4-byte big-endian length and that many bytes of payload.
inline constexpr std::size_t kFrameHeaderSize = 4;

/// Limits of the payload size. Requests are small; descriptions and batches of samples are large.
inline constexpr std::size_t kMaxFrameBeforeHello = std::size_t{4} * 1024;
inline constexpr std::size_t kMaxRequestFrame = std::size_t{64} * 1024;
inline constexpr std::size_t kMaxReplyFrame = std::size_t{1024} * 1024;

/// The header of a payload of this size.
std::array<std::byte, kFrameHeaderSize> frame_header(std::uint32_t payload_size) noexcept;

/// Cuts a byte stream into frames. Holds at most one frame; never allocates after construction.
class FrameReader {
 public:
  /// Reads frames with up to `capacity` bytes of payload; set_max_payload() may lower that limit. The buffer
  /// has room for one frame of the limit, and grows with it.
  explicit FrameReader(std::size_t capacity) : capacity_(capacity), max_payload_(capacity) {}

  void set_max_payload(std::size_t size) noexcept { max_payload_ = size < capacity_ ? size : capacity_; }

  /// The buffer for the next bytes of the stream; empty only while next() has a frame to give.
  std::span<std::byte> free_space();
  /// Reports how many bytes were put into free_space().
  void received(std::size_t count) noexcept { end_ += count; }

  /// The payload of the next whole frame, valid until the next call of free_space(); nothing while the frame
  /// is incomplete, and after an error.
  std::optional<std::span<const std::byte>> next() noexcept;

  /// Whether the buffer holds the beginning of a frame. Valid after next() has returned nothing.
  bool in_a_frame() const noexcept { return begin_ != end_; }

  /// Not empty after a length of zero or above the limit: no later frame of the stream can be found.
  std::string_view error() const noexcept { return error_; }

 private:
  std::vector<std::byte> buffer_;
  std::size_t capacity_;
  std::size_t max_payload_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::string_view error_;
};

}  // namespace drivebench
