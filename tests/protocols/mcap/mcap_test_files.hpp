#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/mcap/mcap.hpp"

/// Recordings for the MCAP tests, and the reader's results.
namespace drivebench::mcap_test {

using Bytes = std::vector<std::byte>;

inline std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}

inline std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

inline McapWriter::Sink append_to(Bytes& file) {
  return [&file](std::span<const std::byte> bytes) { file.insert(file.end(), bytes.begin(), bytes.end()); };
}

/// A message with its own copy of the payload.
struct Kept {
  McapMessageHeader header;
  std::string payload;
  bool operator==(const Kept& other) const {
    return header.channel == other.header.channel && header.sequence == other.header.sequence &&
           header.log_time_ns == other.header.log_time_ns &&
           header.publish_time_ns == other.header.publish_time_ns && payload == other.payload;
  }
};

struct Contents {
  std::vector<Kept> messages;
  std::optional<McapProblem> problem;
};

// Reads from a heap copy of the exact size, so that the address sanitizer sees a read past the end.
inline Contents read_all(std::span<const std::byte> file) {
  const Bytes copy(file.begin(), file.end());
  McapReader reader(copy);
  Contents contents;
  for (McapMessage message; reader.next(message);) {
    contents.messages.push_back({message.header, text_of(message.payload)});
  }
  contents.problem = reader.problem();
  return contents;
}

/// One record of each kind, ids and times with different bytes.
inline Bytes tiny_file() {
  Bytes file;
  McapWriter writer(append_to(file), {.profile = "p", .library = "lib"});
  const auto schema = writer.add_schema("s", "e", bytes_of("\xfe"));
  const auto channel = writer.add_channel("t", schema, "m", {{"k", "v"}});
  writer.add_message({.channel = channel,
                      .sequence = 7,
                      .log_time_ns = 0x0102030405060708,
                      .publish_time_ns = 0x1112131415161718},
                     bytes_of("\xaa\xbb"));
  writer.add_attachment("a", "x/y", 9, bytes_of("\x01\x02"));
  writer.add_metadata("n", {{"k", "v"}});
  writer.finish();
  EXPECT_EQ(writer.bytes_written(), file.size());
  return file;
}

/// Three channels in several chunks, with an attachment and metadata in between.
inline Bytes small_file(std::vector<Kept>& messages) {
  Bytes file;
  McapWriter writer(append_to(file), {.profile = "", .library = "test", .chunk_size = 200});
  const auto schema = writer.add_schema("schema", "protobuf", bytes_of("descriptor"));
  std::array<std::uint16_t, 3> channels{writer.add_channel("a", schema, "protobuf"),
                                        writer.add_channel("b", schema, "protobuf", {{"unit", "V"}}), 0};
  writer.add_attachment("bench.toml", "text/plain", 5, bytes_of("period_s = 0.000125"));
  for (std::uint32_t i = 0; i < 20; ++i) {
    if (i == 9) {
      channels[2] = writer.add_channel("late", 0, "");
      writer.add_metadata("event", {{"tick", "9"}, {"what", "load step"}});
    }
    const Kept message{{.channel = channels[i < 9 ? i % 2 : i % 3],
                        .sequence = i,
                        .log_time_ns = 1000 - i,
                        .publish_time_ns = i},
                       std::string(i, static_cast<char>('a' + i))};
    messages.push_back(message);
    writer.add_message(message.header, bytes_of(message.payload));
  }
  writer.finish();
  return file;
}

struct Place {
  std::uint8_t opcode;
  std::size_t begin;
  std::size_t end;
};

/// The records of a whole, correct file (those inside chunks apart).
inline std::vector<Place> places(const Bytes& file) {
  std::vector<Place> result;
  for (std::size_t at = 8; at + 8 < file.size();) {
    const std::size_t end = at + 9 + mcap::load<std::uint64_t>(file.data() + at + 1);
    result.push_back({std::to_integer<std::uint8_t>(file[at]), at, end});
    at = end;
  }
  return result;
}

}  // namespace drivebench::mcap_test
