#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace drivebench::modbus {

/// Transaction (2 bytes), protocol (2 bytes, zero), length of what follows (2 bytes), unit id.
inline constexpr std::size_t kMbapSize = 7;
inline constexpr std::size_t kMaxAdu = 260;
/// Limits of the length field: unit id and a function code; unit id and the largest PDU.
inline constexpr std::size_t kMinLength = 2;
inline constexpr std::size_t kMaxLength = 254;

/// Cuts a byte stream into Modbus TCP frames. Holds a few kilobytes; never allocates.
class MbapReader {
 public:
  /// Where the next bytes from the stream go; not empty once next() has given nothing.
  std::span<std::uint8_t> free_space() noexcept;
  /// Says how many bytes were put there.
  void received(std::size_t count) noexcept { end_ += count; }

  /// The next whole frame, header included, valid until the next call of free_space(); nothing if it is not
  /// there yet, or if the stream is bad.
  std::optional<std::span<const std::uint8_t>> next() noexcept;

  /// Whether a frame has begun that is not whole yet.
  bool in_frame() const noexcept { return begin_ != end_; }

  /// Not empty once a header was seen that cannot be one: the stream cannot be followed any further.
  std::string_view error() const noexcept { return error_; }

 private:
  std::array<std::uint8_t, 16 * kMaxAdu> buffer_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::string_view error_;
};

}  // namespace drivebench::modbus
