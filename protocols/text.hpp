#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace drivebench {

/// The text as valid UTF-8: at most `most` bytes, cut between characters, '?' for each invalid byte. Decoders
/// refuse a protobuf message with a string that is not valid UTF-8.
std::string utf8(std::string_view text, std::size_t most = std::string_view::npos);

/// Whether the text is valid UTF-8 without characters that move a terminal's cursor or make a name look like
/// another: control characters, line separators, changes of the direction of writing.
bool is_plain(std::string_view text) noexcept;

/// The text for one line of a terminal: plain, with '?' for each other character, cut after 160 bytes.
std::string printable(std::string_view text);

/// In hexadecimal with prefix: 0x1a.
std::string hexadecimal(std::int64_t value);

/// The shortest decimal text that reads back as the same double.
std::string shortest(double value);

}  // namespace drivebench
