#include "protocols/text.hpp"

#include <array>
#include <charconv>

namespace drivebench {
namespace {

/// Size of the UTF-8 character at the start of the text [bytes]; 0 if the text starts with none (Unicode 15,
/// table 3-7).
std::size_t size_of_first(std::string_view text) noexcept {
  const auto byte = [text](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned lead = byte(0);
  if (lead < 0x80) return 1;
  if (lead < 0xC2 || lead > 0xF4) return 0;
  const std::size_t size = lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
  if (text.size() < size) return 0;
  // The second byte shows overlong forms, surrogates and code points above U+10FFFF.
  const unsigned lowest = lead == 0xE0 ? 0xA0 : lead == 0xF0 ? 0x90 : 0x80;
  const unsigned highest = lead == 0xED ? 0x9F : lead == 0xF4 ? 0x8F : 0xBF;
  if (byte(1) < lowest || byte(1) > highest) return 0;
  for (std::size_t i = 2; i < size; ++i)
    if ((byte(i) & 0xC0u) != 0x80u) return 0;
  return size;
}

/// Whether this valid character is one that is_plain() forbids.
bool is_harmful(std::string_view character) noexcept {
  const auto byte = [character](std::size_t i) { return static_cast<unsigned char>(character[i]); };
  const unsigned lead = byte(0);
  if (character.size() == 1) return lead < 0x20 || lead == 0x7F;
  if (character.size() == 2) {
    const unsigned point = (lead & 0x1Fu) << 6 | (byte(1) & 0x3Fu);
    return point < 0xA0 || point == 0x61C;  // C1 controls; the Arabic letter mark
  }
  if (character.size() == 4) return false;
  const unsigned point = (lead & 0x0Fu) << 12 | (byte(1) & 0x3Fu) << 6 | (byte(2) & 0x3Fu);
  // Marks of direction; separators of lines, embeddings and overrides; isolates.
  return point == 0x200E || point == 0x200F || (point >= 0x2028 && point <= 0x202E) ||
         (point >= 0x2066 && point <= 0x2069);
}

}  // namespace

std::string utf8(std::string_view text, std::size_t most) {
  std::string result;
  while (!text.empty()) {
    const std::size_t size = size_of_first(text);
    const std::string_view first = size == 0 ? "?" : text.substr(0, size);
    if (result.size() + first.size() > most) break;
    result += first;
    text.remove_prefix(first.size());
  }
  return result;
}

bool is_plain(std::string_view text) noexcept {
  while (!text.empty()) {
    const std::size_t size = size_of_first(text);
    if (size == 0 || is_harmful(text.substr(0, size))) return false;
    text.remove_prefix(size);
  }
  return true;
}

std::string printable(std::string_view text) {
  constexpr std::size_t kMost = 160;
  const std::string whole = utf8(text, kMost);
  std::string result;
  for (std::string_view rest = whole; !rest.empty();) {
    const std::string_view first = rest.substr(0, size_of_first(rest));
    result += is_harmful(first) ? "?" : first;
    rest.remove_prefix(first.size());
  }
  return whole.size() < text.size() ? result + "..." : result;
}

std::string hexadecimal(std::int64_t value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, 16).ptr;
  return std::string("0x").append(buffer.data(), end);
}

std::string shortest(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

}  // namespace drivebench
