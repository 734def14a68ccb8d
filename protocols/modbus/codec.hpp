#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

/// Values in 16-bit registers.
namespace drivebench::modbus {

enum class Type : std::uint8_t {
  kUnsigned16,
  kSigned16,
  kUnsigned32,
  kSigned32,
  kFloat32,
  kUnsigned64,
  kSigned64,
};

/// The order of the registers of a value: most significant first or last. The first byte of a register is
/// always the more significant one.
enum class WordOrder : std::uint8_t { kAbcd, kCdab };

constexpr std::size_t words_of(Type type) noexcept {
  switch (type) {
    case Type::kUnsigned16:
    case Type::kSigned16:
      return 1;
    case Type::kUnsigned32:
    case Type::kSigned32:
    case Type::kFloat32:
      return 2;
    case Type::kUnsigned64:
    case Type::kSigned64:
      break;
  }
  return 4;
}

/// Writes a value of this type, the low bits of `bits`, into registers.
constexpr void put(std::uint64_t bits, Type type, WordOrder order, std::uint16_t* words) noexcept {
  const std::size_t count = words_of(type);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = order == WordOrder::kCdab ? i : count - 1 - i;
    words[place] = static_cast<std::uint16_t>(bits >> (16 * i));
  }
}

/// Reads the bits of a value; bits above its size are zero.
constexpr std::uint64_t get(Type type, WordOrder order, const std::uint16_t* words) noexcept {
  const std::size_t count = words_of(type);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = order == WordOrder::kCdab ? i : count - 1 - i;
    bits |= std::uint64_t{words[place]} << (16 * i);
  }
  return bits;
}

constexpr std::uint64_t float_bits(double value) noexcept {
  return std::bit_cast<std::uint32_t>(static_cast<float>(value));
}

/// The number that the bits of a value represent, without its scale.
constexpr double number_of(Type type, std::uint64_t bits) noexcept {
  switch (type) {
    case Type::kSigned16:
      return static_cast<double>(static_cast<std::int16_t>(bits));
    case Type::kSigned32:
      return static_cast<double>(static_cast<std::int32_t>(bits));
    case Type::kFloat32:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    case Type::kSigned64:
      return static_cast<double>(static_cast<std::int64_t>(bits));
    case Type::kUnsigned16:
    case Type::kUnsigned32:
    case Type::kUnsigned64:
      break;
  }
  return static_cast<double>(bits);
}

/// A value in 16-bit counts, rounded. Signed: saturates at +-32767, NaN is -32768; unsigned: saturates at 0
/// and 65534, NaN is 65535.
inline std::uint64_t counts_of(Type type, double value, double scale) noexcept {
  const double counts = std::round(value / scale);
  if (type == Type::kSigned16) {
    if (std::isnan(counts)) return 0x8000;
    const double kept = counts < -32767.0 ? -32767.0 : counts > 32767.0 ? 32767.0 : counts;
    return static_cast<std::uint16_t>(static_cast<std::int16_t>(kept));
  }
  if (std::isnan(counts)) return 0xffff;
  return static_cast<std::uint16_t>(counts < 0.0 ? 0.0 : counts > 65534.0 ? 65534.0 : counts);
}

}  // namespace drivebench::modbus
