#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace drivebench::wire {

/// Building blocks of the protobuf wire format, for the few messages that are sent at tick rate.
enum Type : std::uint32_t { kVarint = 0, kFixed64 = 1, kBytes = 2 };

constexpr std::uint64_t tag(std::uint32_t field, Type type) noexcept {
  return field << 3 | type;
}

constexpr std::uint64_t zigzag(std::int64_t value) noexcept {
  return static_cast<std::uint64_t>(value) << 1 ^ static_cast<std::uint64_t>(value >> 63);
}

constexpr std::int64_t unzigzag(std::uint64_t value) noexcept {
  return static_cast<std::int64_t>(value >> 1 ^ (~(value & 1) + 1));
}

inline std::byte* put_varint(std::byte* out, std::uint64_t value) noexcept {
  while (value >= 0x80) {
    *out++ = std::byte(value | 0x80);
    value >>= 7;
  }
  *out++ = std::byte(value);
  return out;
}

inline std::byte* put_fixed64(std::byte* out, std::uint64_t value) noexcept {
  static_assert(std::endian::native == std::endian::little,
                "the wire is little-endian, and so are our hosts");
  std::memcpy(out, &value, sizeof(value));
  return out + sizeof(value);
}

/// Reads a varint and returns the position behind it; null if it is cut off or too long.
inline const std::byte* get_varint(const std::byte* in, const std::byte* end, std::uint64_t& value) noexcept {
  value = 0;
  for (unsigned shift = 0; shift < 70 && in != end; shift += 7) {
    const auto byte = std::to_integer<std::uint64_t>(*in++);
    if (shift < 64) value |= (byte & 0x7f) << shift;
    if (byte < 0x80) return in;
  }
  return nullptr;
}

}  // namespace drivebench::wire
