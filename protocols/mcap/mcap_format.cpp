#include "protocols/mcap/mcap_format.hpp"

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace drivebench::mcap {

std::uint32_t crc32_of(std::uint32_t crc, std::span<const std::byte> bytes) noexcept {
  if (bytes.empty()) return crc;  // for a null pointer zlib returns the initial value
  return static_cast<std::uint32_t>(
      ::crc32_z(crc, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

std::uint32_t crc32_joined(std::uint32_t first, std::uint32_t second, std::uint64_t second_size) noexcept {
  return static_cast<std::uint32_t>(::crc32_combine(first, second, static_cast<z_off_t>(second_size)));
}

void Buffer::put_bytes(std::span<const std::byte> bytes) {
  if (bytes.empty()) return;
  std::memcpy(reserve(bytes.size()), bytes.data(), bytes.size());
  advance(bytes.size());
}

void Buffer::put_string(std::string_view text) {
  if (text.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw std::length_error("MCAP: a string is longer than 4 GiB");
  }
  put(static_cast<std::uint32_t>(text.size()));
  put_bytes(std::as_bytes(std::span(text)));
}

void Buffer::put_map(const McapMap& map) {
  const std::size_t begin = size_;
  put(std::uint32_t{0});
  for (const auto& [key, value] : map) {
    put_string(key);
    put_string(value);
  }
  const std::size_t size = size_ - begin - sizeof(std::uint32_t);
  if (size > std::numeric_limits<std::uint32_t>::max()) {
    throw std::length_error("MCAP: a map is longer than 4 GiB");
  }
  store(data() + begin, static_cast<std::uint32_t>(size));
}

std::size_t Buffer::begin_record(Opcode opcode) {
  const std::size_t begin = size_;
  put(static_cast<std::uint8_t>(opcode));
  put(std::uint64_t{0});
  return begin;
}

void Buffer::end_record(std::size_t begin) noexcept {
  store(data() + begin + 1, std::uint64_t{size_ - begin - kRecordHead});
}

void Buffer::grow(std::size_t size) {
  if (size > std::numeric_limits<std::size_t>::max() / 2 - capacity_) {
    throw std::length_error("MCAP: a buffer would not fit into memory");
  }
  const std::size_t capacity = std::max({size_ + size, 2 * capacity_, std::size_t{256}});
  auto bytes = std::make_unique_for_overwrite<std::byte[]>(capacity);
  if (size_ != 0) std::memcpy(bytes.get(), bytes_.get(), size_);
  bytes_ = std::move(bytes);
  capacity_ = capacity;
}

}  // namespace drivebench::mcap
