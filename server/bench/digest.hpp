#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace drivebench {

/// Words of a block, counted from its start.
struct WordRange {
  std::size_t first;
  std::size_t count;
};

/// The words of a block that later builds have added, in the order in which they stand there. A digest passes
/// over each range while all of its words are zero: a bench that does not use them keeps its hashes, and with
/// them its recordings.
template <class Block>
inline constexpr auto kLaterWords = std::array<WordRange, 0>{};

/// Mixes words into a 64-bit digest. Four lanes, so that the multiplications overlap; not cryptographic.
class Digest {
 public:
  constexpr void add(std::uint64_t word) noexcept {
    lane_at(0) = mixed(lane_at(0), word);
    ++position_;
  }

  /// Adds a struct of 8-byte members word by word.
  template <class Block>
  void add_block(const Block& block) noexcept {
    static_assert(std::is_trivially_copyable_v<Block> && sizeof(Block) % 8 == 0);
    const auto* const bytes = reinterpret_cast<const unsigned char*>(&block);
    add_from<Block, 0, 0>(bytes);
  }

  /// The digest of the words so far, their order and their number.
  constexpr std::uint64_t value() const noexcept {
    std::uint64_t result = position_;
    for (const std::uint64_t lane : lanes_)
      result = (std::rotl(result, 23) ^ lane) * 0xc2b2'ae3d'27d4'eb4fu;
    return result ^ (result >> 32);
  }

 private:
  static std::uint64_t word_at(const unsigned char* bytes, std::size_t n) noexcept {
    std::uint64_t result;
    std::memcpy(&result, bytes + 8 * n, 8);
    return result;
  }

  /// Adds the words of a block from kFirst on; kRange is the next of its ranges.
  template <class Block, std::size_t kFirst, std::size_t kRange>
  void add_from(const unsigned char* bytes) noexcept {
    if constexpr (kRange == kLaterWords<Block>.size()) {
      add_words<sizeof(Block) / 8 - kFirst>(bytes + 8 * kFirst);
    } else {
      constexpr WordRange kLater = kLaterWords<Block>[kRange];
      add_words<kLater.first - kFirst>(bytes + 8 * kFirst);
      if (any_set<kLater.count>(bytes + 8 * kLater.first)) {
        add_words<kLater.count>(bytes + 8 * kLater.first);
      }
      add_from<Block, kLater.first + kLater.count, kRange + 1>(bytes);
    }
  }

  template <std::size_t kWords>
  static bool any_set(const unsigned char* bytes) noexcept {
    std::uint64_t any = 0;
    for (std::size_t n = 0; n < kWords; ++n)
      any |= word_at(bytes, n);
    return any != 0;
  }

  template <std::size_t kWords>
  void add_words(const unsigned char* bytes) noexcept {
    const auto word = [bytes](std::size_t n) noexcept { return word_at(bytes, n); };
    constexpr std::size_t kInFours = kWords - kWords % 4;
    std::uint64_t first = lane_at(0);  // keeps all four lanes in registers
    std::uint64_t second = lane_at(1);
    std::uint64_t third = lane_at(2);
    std::uint64_t fourth = lane_at(3);
    for (std::size_t next = 0; next < kInFours; next += 4) {
      first = mixed(first, word(next));
      second = mixed(second, word(next + 1));
      third = mixed(third, word(next + 2));
      fourth = mixed(fourth, word(next + 3));
    }
    if constexpr (kWords % 4 > 0) first = mixed(first, word(kInFours));
    if constexpr (kWords % 4 > 1) second = mixed(second, word(kInFours + 1));
    if constexpr (kWords % 4 > 2) third = mixed(third, word(kInFours + 2));
    lane_at(0) = first;
    lane_at(1) = second;
    lane_at(2) = third;
    lane_at(3) = fourth;
    position_ += kWords;
  }

  /// The lane for the n-th next word.
  constexpr std::uint64_t& lane_at(std::size_t n) noexcept { return lanes_[(position_ + n) & 3u]; }

  static constexpr std::uint64_t mixed(std::uint64_t lane, std::uint64_t word) noexcept {
    return std::rotl((lane ^ word) * 0x9e37'79b9'7f4a'7c15u, 29);
  }

  std::array<std::uint64_t, 4> lanes_{0x243f'6a88'85a3'08d3u, 0x1319'8a2e'0370'7344u, 0xa409'3822'299f'31d0u,
                                      0x082e'fa98'ec4e'6c89u};
  std::uint64_t position_ = 0;
};

}  // namespace drivebench
