#include "protocols/modbus/mbap.hpp"

#include <algorithm>

namespace drivebench::modbus {

std::span<std::uint8_t> MbapReader::free_space() noexcept {
  if (begin_ > 0) {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
              buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
    end_ -= begin_;
    begin_ = 0;
  }
  return std::span(buffer_).subspan(end_);
}

std::optional<std::span<const std::uint8_t>> MbapReader::next() noexcept {
  const std::span<const std::uint8_t> bytes = std::span(buffer_).subspan(begin_, end_ - begin_);
  if (!error_.empty() || bytes.size() < 6) return std::nullopt;
  const std::size_t length = std::size_t{bytes[4]} << 8 | bytes[5];
  if (bytes[2] != 0 || bytes[3] != 0) {
    error_ = "the protocol id is not 0";
  } else if (length < kMinLength || length > kMaxLength) {
    error_ = "the length is not 2 to 254";
  } else if (bytes.size() >= 6 + length) {
    begin_ += 6 + length;
    return bytes.first(6 + length);
  }
  return std::nullopt;
}

}  // namespace drivebench::modbus
