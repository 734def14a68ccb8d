#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace drivebench {

/// Mixes words into a 64-bit digest. Four lanes, so that the multiplications overlap; not cryptographic.
class Digest {
 public:
  constexpr void add(std::uint64_t word) noexcept {
    std::uint64_t& lane = lanes_[position_++ & 3u];
    lane = mixed(lane, word);
  }

  /// Adds a struct of 8-byte members word by word.
  template <class Block>
  void add_block(const Block& block) noexcept {
    static_assert(std::is_trivially_copyable_v<Block> && sizeof(Block) % 8 == 0);
    constexpr std::size_t kWords = sizeof(Block) / 8;
    const auto* const bytes = reinterpret_cast<const unsigned char*>(&block);
    const auto word = [bytes](std::size_t n) noexcept {
      std::uint64_t result;
      std::memcpy(&result, bytes + 8 * n, 8);
      return result;
    };
    std::size_t next = 0;
    for (; next < kWords && (position_ & 3u) != 0; ++next)
      add(word(next));
    auto [first, second, third, fourth] = lanes_;  // in registers
    for (; next + 4 <= kWords; next += 4, position_ += 4) {
      first = mixed(first, word(next));
      second = mixed(second, word(next + 1));
      third = mixed(third, word(next + 2));
      fourth = mixed(fourth, word(next + 3));
    }
    lanes_ = {first, second, third, fourth};
    for (; next < kWords; ++next)
      add(word(next));
  }

  /// Of the words so far, their order and their number.
  constexpr std::uint64_t value() const noexcept {
    std::uint64_t result = position_;
    for (const std::uint64_t lane : lanes_)
      result = (std::rotl(result, 23) ^ lane) * 0xc2b2'ae3d'27d4'eb4fu;
    return result ^ (result >> 32);
  }

 private:
  static constexpr std::uint64_t mixed(std::uint64_t lane, std::uint64_t word) noexcept {
    return std::rotl((lane ^ word) * 0x9e37'79b9'7f4a'7c15u, 29);
  }

  std::array<std::uint64_t, 4> lanes_{0x243f'6a88'85a3'08d3u, 0x1319'8a2e'0370'7344u, 0xa409'3822'299f'31d0u,
                                      0x082e'fa98'ec4e'6c89u};
  std::uint64_t position_ = 0;
};

}  // namespace drivebench
