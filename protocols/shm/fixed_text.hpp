#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <string>
#include <string_view>

/// Texts in memory that two programs share, each with a zero behind it.
namespace drivebench::shm {

/// The end of a text that is too long is lost.
template <std::size_t n>
void put_text(std::array<char, n>& to, std::string_view from) noexcept {
  to[from.copy(to.data(), n - 1)] = '\0';
}

/// A text that the other program has written; it ends at its zero or with the array.
template <std::size_t n>
std::string text_in(const std::array<char, n>& from) {
  return {from.data(), ::strnlen(from.data(), n)};
}

}  // namespace drivebench::shm
