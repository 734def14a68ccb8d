#include "protocols/framing.hpp"

#include <algorithm>
#include <cstring>

namespace drivebench {

std::array<std::byte, kFrameHeaderSize> frame_header(std::uint32_t payload_size) noexcept {
  return {std::byte(payload_size >> 24), std::byte(payload_size >> 16), std::byte(payload_size >> 8),
          std::byte(payload_size)};
}

std::span<std::byte> FrameReader::free_space() {
  if (begin_ == end_) {
    begin_ = end_ = 0;
  } else if (begin_ > 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  buffer_.resize(std::max(buffer_.size(), kFrameHeaderSize + max_payload_));
  return std::span(buffer_).subspan(end_);
}

std::optional<std::span<const std::byte>> FrameReader::next() noexcept {
  if (end_ - begin_ < kFrameHeaderSize || !error_.empty()) return std::nullopt;
  std::uint32_t size = 0;
  for (std::size_t i = 0; i < kFrameHeaderSize; ++i) {
    size = size << 8 | std::to_integer<std::uint32_t>(buffer_[begin_ + i]);
  }
  if (size == 0) error_ = "a frame of length 0: an envelope is never empty";
  if (size > max_payload_) error_ = "a frame longer than allowed here";
  if (!error_.empty() || end_ - begin_ - kFrameHeaderSize < size) return std::nullopt;
  const std::span<const std::byte> payload = std::span(buffer_).subspan(begin_ + kFrameHeaderSize, size);
  begin_ += kFrameHeaderSize + size;
  return payload;
}

}  // namespace drivebench
