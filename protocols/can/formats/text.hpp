#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// Shared parts of the text formats.

/// The first second of the year 10000, counted from 1970.
inline constexpr double kEndOfTime = 253402300800.0;

/// The number that the whole text spells in digits, without sign, "0x" or space.
template <std::unsigned_integral T = std::uint32_t>
std::optional<T> parse_number(std::string_view text, int base) noexcept {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Appends the low `digits` digits in upper case, with leading zeros.
inline void append_hex(std::string& out, std::uint32_t value, int digits) {
  for (int shift = 4 * (digits - 1); shift >= 0; shift -= 4)
    out.push_back("0123456789ABCDEF"[value >> shift & 0xF]);
}

/// Appends three digits, or eight for an extended identifier.
inline void append_id(std::string& out, const Frame& frame) {
  append_hex(out, frame.id, frame.extended ? 8 : 3);
}

inline void append_data(std::string& out, const Frame& frame) {
  for (std::size_t i = 0; i < frame.size; ++i)
    append_hex(out, frame.data[i], 2);
}

/// Reads the data of the frame, two digits per byte; false if the text has other characters or too many
/// bytes.
inline bool parse_data(std::string_view digits, Frame& frame) noexcept {
  if (digits.size() % 2 != 0 || digits.size() / 2 > frame.data.size()) return false;
  for (std::size_t i = 0; i < digits.size() / 2; ++i) {
    const auto byte = parse_number<std::uint8_t>(digits.substr(2 * i, 2), 16);
    if (!byte) return false;
    frame.data[i] = *byte;
  }
  frame.size = static_cast<std::uint8_t>(digits.size() / 2);
  return true;
}

/// Appends seconds with six decimals, from 0 up to the year 9999.
inline void append_time(std::string& out, double time_s) {
  const bool possible = time_s >= 0.0 && time_s < kEndOfTime;
  const auto time_us = static_cast<std::uint64_t>(possible ? std::llround(time_s * 1e6) : 0);
  const std::string fraction = std::to_string(time_us % 1'000'000);
  out += std::to_string(time_us / 1'000'000);
  out += '.';
  out.append(6 - fraction.size(), '0');
  out += fraction;
}

/// Reads such a time: digits, a point and six digits.
inline std::optional<double> parse_time(std::string_view text) noexcept {
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos || text.size() - point != 7) return std::nullopt;
  const auto seconds = parse_number<std::uint64_t>(text.substr(0, point), 10);
  const auto micros = parse_number(text.substr(point + 1), 10);
  if (!seconds || !micros || static_cast<double>(*seconds) >= kEndOfTime) return std::nullopt;
  return static_cast<double>(*seconds * 1'000'000 + *micros) * 1e-6;
}

/// Whether a bus can carry this frame.
constexpr bool is_possible(const Frame& frame) noexcept {
  if (frame.id > (frame.extended || frame.error ? kMaxExtendedId : kMaxStandardId)) return false;
  if (frame.remote && (frame.fd || frame.error)) return false;
  if ((frame.bit_rate_switch || frame.error_state) && !frame.fd) return false;
  return frame.fd ? is_fd_size(frame.size) : frame.size <= 8;
}

}  // namespace drivebench::can
