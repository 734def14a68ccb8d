#pragma once

#include <cstdint>
#include <string_view>

namespace drivebench::can {

/// Encoding of a field.
enum class Encoding : std::uint8_t {
  kCounter,  ///< unsigned; the low bits of a number that wraps around
  kSigned,   ///< two's complement; the low bits of a number that wraps around
  kCode,     ///< unsigned enumeration or bits; values that do not fit saturate
  kUScaled,  ///< unsigned times the unit; all ones: no value or NaN; saturates one below that
  kScaled,   ///< two's complement times the unit; the lowest number: no value or NaN; saturates at
             ///< +-(2^(n-1)-1)
  kFloat,    ///< IEEE 754 single; NaN: no value
};

/// The unit of a scaled field; the configuration gives its size.
enum class Unit : std::uint8_t {
  kNone,
  kCurrent,
  kVoltage,
  kBusVoltage,
  kSpeed,
  kEdgeTime,
  kResolver,     ///< always 1 mV
  kTemperature,  ///< always 0.1 K
  kDuty,         ///< always 1/32767
};

/// The page number of a field that stands in every frame of its message.
inline constexpr std::uint8_t kEveryPage = 0xFF;

struct Field {
  std::string_view name;
  std::string_view unit;
  std::uint16_t start_bit;  ///< of the least significant bit: 8 * byte + bit
  std::uint8_t bits;
  Encoding encoding;
  Unit scale;               ///< of the scaled encodings
  std::string_view signal;  ///< the signal of the catalogue that the field carries; empty: none
  std::string_view meaning;
  /// The field stands only in frames with this value of the field `page`; kEveryPage: in all frames.
  std::uint8_t page = kEveryPage;
  /// A set-point: a voltage in mode 1, a duty or a current in others: see fields_of().
  bool is_setpoint = false;
};

/// Whether a field stands in the frames of this page.
constexpr bool is_on_page(const Field& field, std::uint64_t page) noexcept {
  return field.page == kEveryPage || field.page == page;
}

namespace table_detail {

constexpr Field counter(std::string_view name, std::uint16_t start, std::uint8_t bits,
                        std::string_view signal, std::string_view meaning) {
  return {name, "1", start, bits, Encoding::kCounter, Unit::kNone, signal, meaning};
}
constexpr Field counts(std::string_view name, std::uint16_t start, std::string_view signal,
                       std::string_view meaning) {
  return {name, "counts", start, 32, Encoding::kSigned, Unit::kNone, signal, meaning};
}
constexpr Field code(std::string_view name, std::uint16_t start, std::uint8_t bits, std::string_view signal,
                     std::string_view meaning) {
  return {name, "1", start, bits, Encoding::kCode, Unit::kNone, signal, meaning};
}
/// A field whose meaning lists its numbers: "0 this, 1 that". The text after a colon explains.
constexpr Field choice(std::string_view name, std::uint16_t start, std::string_view signal,
                       std::string_view meaning) {
  return {name, "enum", start, 8, Encoding::kCode, Unit::kNone, signal, meaning};
}
constexpr Field flags(std::string_view name, std::uint16_t start, std::uint8_t bits, std::string_view signal,
                      std::string_view meaning) {
  return {name, "bits", start, bits, Encoding::kCode, Unit::kNone, signal, meaning};
}
constexpr Field scaled(std::string_view name, std::string_view unit, std::uint16_t start, Unit scale,
                       std::string_view signal, std::string_view meaning) {
  return {name, unit, start, 16, Encoding::kScaled, scale, signal, meaning};
}
constexpr Field unsigned_scaled(std::string_view name, std::string_view unit, std::uint16_t start, Unit scale,
                                std::string_view signal, std::string_view meaning) {
  return {name, unit, start, 16, Encoding::kUScaled, scale, signal, meaning};
}
constexpr Field real(std::string_view name, std::string_view unit, std::uint16_t start,
                     std::string_view signal, std::string_view meaning) {
  return {name, unit, start, 32, Encoding::kFloat, Unit::kNone, signal, meaning};
}
/// A code in half a byte.
constexpr Field half_byte(Field field) {
  field.bits = 4;
  return field;
}
constexpr Field setpoint(Field field) {
  field.is_setpoint = true;
  return field;
}
constexpr Field on_page(std::uint8_t page, Field field) {
  field.page = page;
  return field;
}

}  // namespace table_detail

}  // namespace drivebench::can
