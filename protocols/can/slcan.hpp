#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// The ASCII protocol of Lawicel's serial adapters, which most cheap adapters, slcand and python-can speak: a
/// line per command or frame, ended by CR; an answer is CR, a letter and something and CR, or BELL for no.
/// FD frames (d, D, b, B) as the CANable firmware and python-can >= 4.5 write them; they say nothing about
/// the error state.

/// Answers.
inline constexpr char kSlcanOk = '\r';
inline constexpr char kSlcanRefused = '\a';

/// The longest line without its end: "B", 8 digits, length, 64 bytes, time stamp.
inline constexpr std::size_t kMaxSlcanLine = 1 + 8 + 1 + 2 * 64 + 4;

/// Appends the frame as a line with its CR; with a time stamp [ms] if there is one. Error frames, which the
/// protocol does not know, append nothing.
void append_slcan(std::string& out, const Frame& frame, std::optional<std::uint16_t> stamp_ms = {});

/// Reads the line of a frame, without its end; a time stamp behind it is passed over. Nothing if it is
/// anything else.
std::optional<Frame> parse_slcan(std::string_view line) noexcept;

/// The command that asks an adapter for this bit rate ("S8" is 1 Mbit/s) or data bit rate ("Y5" is
/// 5 Mbit/s), if there is one.
std::optional<std::string_view> slcan_bit_rate(std::int64_t bit_rate) noexcept;
std::optional<std::string_view> slcan_data_bit_rate(std::int64_t data_bit_rate) noexcept;

/// Cuts a byte stream into lines.
class SlcanReader {
 public:
  struct Line {
    std::string_view text;  ///< without its end, valid until the next byte
    bool refusal = false;   ///< ended by BELL
    bool too_long = false;  ///< no line of this protocol; the text is its beginning
  };

  /// Takes a byte; a line if it was the end of one. Line feeds are passed over.
  std::optional<Line> push(char byte) noexcept;

 private:
  std::array<char, kMaxSlcanLine> line_{};
  std::size_t size_ = 0;
  bool too_long_ = false;
};

}  // namespace drivebench::can
