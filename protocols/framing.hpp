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

/// Size caps of the payload. Requests are small; descriptions and batches of samples are not.
inline constexpr std::size_t kMaxFrameBeforeHello = std::size_t{4} * 1024;
inline constexpr std::size_t kMaxRequestFrame = std::size_t{64} * 1024;
inline constexpr std::size_t kMaxReplyFrame = std::size_t{1024} * 1024;

/// What stands before a payload of this size.
std::array<std::byte, kFrameHeaderSize> frame_header(std::uint32_t payload_size) noexcept;

/// Cuts a byte stream into frames. Holds at most one frame; never allocates after construction.
class FrameReader {
 public:
  /// Frames up to `capacity` bytes of payload; max_payload may be lowered and raised within that.
  explicit FrameReader(std::size_t capacity);

  void set_max_payload(std::size_t size) noexcept { max_payload_ = size < capacity_ ? size : capacity_; }

  /// Where the next bytes from the stream go; never empty unless a frame is waiting in next().
  std::span<std::byte> free_space() noexcept;
  /// Says how many bytes were put there.
  void received(std::size_t count) noexcept { end_ += count; }

  /// The payload of the next whole frame, valid until the next call of free_space(); nothing if it is not
  /// there yet, or if the stream is bad.
  std::optional<std::span<const std::byte>> next() noexcept;

  /// Whether a frame has begun that is not whole yet. To be asked when next() has nothing more.
  bool in_a_frame() const noexcept { return begin_ != end_; }

  /// Not empty once a length of zero or above the cap has been seen: the stream cannot be followed any
  /// further.
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
