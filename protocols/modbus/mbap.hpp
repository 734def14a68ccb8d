#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace drivebench::modbus {

/// Header: transaction (2 bytes), protocol (2 bytes, zero), length of the rest (2 bytes), unit id.
inline constexpr std::size_t kMbapSize = 7;
inline constexpr std::size_t kMaxAdu = 260;
/// Limits of the length field: from unit id and function code to unit id and the largest PDU.
inline constexpr std::size_t kMinLength = 2;
inline constexpr std::size_t kMaxLength = 254;

/// Cuts a byte stream into Modbus TCP frames. Never allocates.
class MbapReader {
 public:
  /// The buffer for the next bytes of the stream; not empty after next() has returned nothing.
  std::span<std::uint8_t> free_space() noexcept;
  /// Reports how many bytes were put into free_space().
  void received(std::size_t count) noexcept { end_ += count; }

  /// The next whole frame with its header, valid until the next call of free_space(); nothing while the frame
  /// is incomplete, and after an error.
  std::optional<std::span<const std::uint8_t>> next() noexcept;

  /// Whether the buffer holds the beginning of a frame.
  bool in_frame() const noexcept { return begin_ != end_; }

  /// Not empty after an invalid header: no later frame of the stream can be found.
  std::string_view error() const noexcept { return error_; }

 private:
  std::array<std::uint8_t, 16 * kMaxAdu> buffer_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::string_view error_;
};

}  // namespace drivebench::modbus
