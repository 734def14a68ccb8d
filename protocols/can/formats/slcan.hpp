#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocols/can/frame.hpp"

namespace drivebench::can {

/// The ASCII protocol of Lawicel's serial adapters, which most cheap adapters, slcand and python-can speak:
/// one line per command or frame, ended by CR. An answer is CR alone or a line that starts with a letter;
/// BELL refuses. FD frames (d, D, b, B) are those of the CANable firmware and python-can >= 4.5, without the
/// error state.

/// Answers.
inline constexpr char kSlcanOk = '\r';
inline constexpr char kSlcanRefused = '\a';

/// The length of the longest line without its end: "B", 8 digits, length, 64 bytes, time stamp.
inline constexpr std::size_t kMaxSlcanLine = 1 + 8 + 1 + 2 * 64 + 4;

/// Appends the frame as a line with CR, with a time stamp [ms] if given. The protocol has no error frames:
/// they append nothing.
void append_slcan(std::string& out, const Frame& frame, std::optional<std::uint16_t> stamp_ms = {});

/// Reads the line of a frame, without its end; skips a time stamp. Nothing if the line is no frame.
std::optional<Frame> parse_slcan(std::string_view line) noexcept;

/// The command that sets this bit rate ("S8" is 1 Mbit/s) or data bit rate ("Y5" is 5 Mbit/s) of an adapter;
/// nothing if the protocol has none.
std::optional<std::string_view> slcan_bit_rate(std::int64_t bit_rate) noexcept;
std::optional<std::string_view> slcan_data_bit_rate(std::int64_t data_bit_rate) noexcept;

/// Cuts a byte stream into lines.
class SlcanReader {
 public:
  struct Line {
    std::string_view text;  ///< without its end, valid until the next byte
    bool refusal = false;   ///< ended by BELL
    bool too_long = false;  ///< longer than any line of the protocol; the text is its beginning
  };

  /// Takes a byte and returns the line that it ends, if any. Skips line feeds.
  std::optional<Line> push(char byte) noexcept;

 private:
  std::array<char, kMaxSlcanLine> line_{};
  std::size_t size_ = 0;
  bool too_long_ = false;
};

}  // namespace drivebench::can
