#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

/// Shared by the MCAP writer and reader: record codes, little-endian integers, CRC32, a growing byte buffer.
/// The format: https://mcap.dev/spec, major version 0. Other files include "protocols/mcap/mcap.hpp".
namespace drivebench {

/// Keys and values of metadata; sorted, so that the same entries always give the same bytes.
using McapMap = std::map<std::string, std::string, std::less<>>;

namespace mcap {

inline constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};

/// A record is its code, the length of its content as uint64, and the content.
enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// Code and length in front of every record's content.
inline constexpr std::size_t kRecordHead = 1 + 8;
/// Channel, sequence, log time, publish time in front of a message's payload.
inline constexpr std::size_t kMessageHead = 2 + 4 + 8 + 8;
inline constexpr std::size_t kFooterSize = 8 + 8 + 4;

// Unrolled at compile time, so that compilers merge the bytes into one move; runs six times per message.
template <std::unsigned_integral T>
void store(std::byte* at, T value) noexcept {
  const auto store_all = [&]<std::size_t... kByte>(std::index_sequence<kByte...>) {
    ((at[kByte] = static_cast<std::byte>(value >> (8 * kByte))), ...);
  };
  store_all(std::make_index_sequence<sizeof(T)>{});
}

template <std::unsigned_integral T>
T load(const std::byte* at) noexcept {
  const auto load_all = [&]<std::size_t... kByte>(std::index_sequence<kByte...>) {
    return static_cast<T>(((std::to_integer<std::uint64_t>(at[kByte]) << (8 * kByte)) | ...));
  };
  return load_all(std::make_index_sequence<sizeof(T)>{});
}

/// Continues a CRC32 (that of zlib and Ethernet) over `bytes`; 0 is the CRC of no bytes.
std::uint32_t crc32_of(std::uint32_t crc, std::span<const std::byte> bytes) noexcept;

/// The CRC32 of two runs of bytes, computed from the CRC32 of each and the size of the second. The bytes of a
/// chunk are thus read once for its own checksum and that of the data section.
std::uint32_t crc32_joined(std::uint32_t first, std::uint32_t second, std::uint64_t second_size) noexcept;

/// A growing run of bytes. Unlike std::vector it does not clear reserved bytes, which would write every
/// message twice.
class Buffer {
 public:
  /// Reserves `size` bytes behind the end; the pointer is valid until the next call.
  std::byte* reserve(std::size_t size) {
    if (capacity_ - size_ < size) grow(size);
    return bytes_.get() + size_;
  }
  /// The first `size` bytes of the reserved room now belong to the buffer.
  void advance(std::size_t size) noexcept { size_ += size; }
  void clear() noexcept { size_ = 0; }

  std::size_t size() const noexcept { return size_; }
  std::byte* data() noexcept { return bytes_.get(); }
  std::span<const std::byte> bytes() const noexcept { return {bytes_.get(), size_}; }

  template <std::unsigned_integral T>
  void put(T value) {
    store(reserve(sizeof(T)), value);
    advance(sizeof(T));
  }
  void put_bytes(std::span<const std::byte> bytes);
  /// Writes a uint32 length and the bytes.
  void put_string(std::string_view text);
  void put_map(const McapMap& map);

  /// Starts a record; end_record() fills in its length. Records do not nest.
  std::size_t begin_record(Opcode opcode);
  void end_record(std::size_t begin) noexcept;

 private:
  void grow(std::size_t size);

  std::unique_ptr<std::byte[]> bytes_;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace mcap
}  // namespace drivebench
