// The MCAP reader on files that are cut, flipped, forged or foreign.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "protocols/mcap/mcap.hpp"
#include "tests/protocols/mcap/mcap_test_files.hpp"

namespace drivebench::mcap_test {
namespace {

using Kind = McapProblem::Kind;

bool is_prefix(const std::vector<Kept>& part, const std::vector<Kept>& whole) {
  return part.size() <= whole.size() && std::equal(part.begin(), part.end(), whole.begin());
}

/// All checksums 0, which means "not available": damage then reaches the parser behind them.
Bytes without_checksums(Bytes file) {
  for (const Place& place : places(file)) {
    if (place.opcode == 0x06) mcap::store(file.data() + place.begin + 33, std::uint32_t{0});
    if (place.opcode == 0x09 || place.opcode == 0x02 || place.opcode == 0x0F) {
      mcap::store(file.data() + place.end - 4, std::uint32_t{0});
    }
  }
  return file;
}

// Catches: a read past the end, a message made of a torn record, a torn file that passes for whole.
TEST(McapReader, REC_01_REC_09_FileCutAtAnyByteGivesItsFirstMessagesAndIsTruncated) {
  std::vector<Kept> written;
  const Bytes file = small_file(written);
  std::size_t last_count = 0;
  for (std::size_t size = 0; size < file.size(); ++size) {
    const Contents contents = read_all(std::span(file).first(size));
    ASSERT_TRUE(contents.problem) << size;
    EXPECT_EQ(contents.problem->kind, Kind::kTruncated) << size << ": " << contents.problem->what;
    EXPECT_LE(contents.problem->offset, size);
    EXPECT_TRUE(is_prefix(contents.messages, written)) << size;
    EXPECT_GE(contents.messages.size(), last_count) << "a longer piece gave fewer messages at " << size;
    last_count = contents.messages.size();
  }
  EXPECT_EQ(last_count, written.size());
}

// Catches: a part of the file that no checksum and no rule covers.
TEST(McapReader, REC_09_EverySingleFlippedBitIsNoticed) {
  std::vector<Kept> written;
  for (Bytes file : {tiny_file(), small_file(written)}) {
    ASSERT_FALSE(read_all(file).problem);
    for (std::size_t bit = 0; bit < 8 * file.size(); ++bit) {
      const auto mask = std::byte{1} << static_cast<int>(bit % 8);
      file[bit / 8] ^= mask;
      EXPECT_TRUE(read_all(file).problem) << "bit " << bit % 8 << " of byte " << bit / 8;
      file[bit / 8] ^= mask;
    }
  }
}

// Catches: a message of a damaged chunk that is delivered before the damage is seen.
TEST(McapReader, DamagedChunkDeliversNoMessage) {
  Bytes file = tiny_file();
  const Place chunk = places(file).at(1);
  ASSERT_EQ(chunk.opcode, 0x06);
  file[chunk.end - 1] ^= std::byte{0x10};
  const Contents contents = read_all(file);
  EXPECT_TRUE(contents.messages.empty());
  ASSERT_TRUE(contents.problem);
  EXPECT_EQ(contents.problem->kind, Kind::kDamaged);
  EXPECT_EQ(contents.problem->offset, chunk.begin);
  EXPECT_EQ(contents.problem->what,
            "byte 29: record \"chunk\": the CRC32 of its records is 0xd4554a94 in the file and 0xc9e25af0 "
            "over its bytes");
}

// Catches: any length, id or count that is trusted once the checksums do not stand in front of it (a forger
// sets them right). Nothing may crash or run on; the sanitizers watch.
TEST(McapReader, REC_09_HostileFilesWithoutChecksumsNeverCrash) {
  std::vector<Kept> written;
  const std::array<Bytes, 2> files{without_checksums(tiny_file()), without_checksums(small_file(written))};
  constexpr auto kNasty = std::to_array<std::uint64_t>(
      {0, 1, 8, 9, 0x7F, 0xFFFF, 0x7FFF'FFFF, 0xFFFF'FFFF, std::uint64_t{1} << 63,
       std::numeric_limits<std::uint64_t>::max(), std::numeric_limits<std::uint64_t>::max() - 8});
  for (Bytes file : files) {
    ASSERT_FALSE(read_all(file).problem) << "a missing checksum is allowed";
    for (std::size_t at = 0; at + 8 <= file.size(); ++at) {
      const Bytes whole = file;
      for (const std::uint64_t value : kNasty) {
        mcap::store(file.data() + at, value);
        read_all(file);
        std::copy_n(whole.begin() + static_cast<std::ptrdiff_t>(at), 8,
                    file.begin() + static_cast<std::ptrdiff_t>(at));
        mcap::store(file.data() + at, static_cast<std::uint32_t>(value));
        read_all(file);
        std::copy_n(whole.begin() + static_cast<std::ptrdiff_t>(at), 8,
                    file.begin() + static_cast<std::ptrdiff_t>(at));
      }
    }
  }
  std::mt19937_64 random(20240607);
  for (int round = 0; round < 20'000; ++round) {
    Bytes file = files[random() % 2];
    for (std::uint64_t changes = 1 + random() % 4; changes > 0; --changes) {
      file[random() % file.size()] = static_cast<std::byte>(random());
    }
    file.resize(file.size() - (random() % 8 == 0 ? random() % file.size() : 0));
    read_all(file);
  }
}

// Catches: a wrong record that a file with right checksums may still contain.
TEST(McapReader, ContradictionsAreNamed) {
  const Bytes file = without_checksums(tiny_file());
  const auto records = places(file);
  const auto problem_with = [&](std::size_t at, std::uint8_t value) {
    Bytes changed = file;
    changed.at(at) = std::byte{value};
    const Contents contents = read_all(changed);
    return contents.problem ? contents.problem->what : std::string("none");
  };
  const auto find = [&](std::uint8_t opcode) {
    return std::find_if(records.begin(), records.end(), [&](const Place& p) { return p.opcode == opcode; })
        ->begin;
  };
  const std::size_t schema_in_chunk = find(0x06) + 49;
  const std::size_t channel_in_chunk = schema_in_chunk + 26;
  const std::size_t message_in_chunk = channel_in_chunk + 37;
  EXPECT_EQ(problem_with(message_in_chunk + 9, 1),
            "byte 141: record \"message\": its channel 1 has not come before it");
  EXPECT_EQ(problem_with(channel_in_chunk + 11, 2),
            "byte 104: record \"channel\": its schema 2 has not come before it");
  EXPECT_EQ(problem_with(schema_in_chunk, 0x0A),
            "byte 78: record \"attachment index\": it may not be in a chunk");
  EXPECT_EQ(problem_with(message_in_chunk + 1, 25), "byte 141: a record in a chunk is longer than the chunk");
  EXPECT_EQ(problem_with(find(0x06) + 25, 95), "byte 29: record \"chunk\": its two sizes differ");
  EXPECT_EQ(problem_with(find(0x07), 0x08),
            "byte 174: record \"chunk index\": it may not be in the data section");
  EXPECT_EQ(problem_with(find(0x0F), 0x02), "byte 284: record \"footer\": it may not be in the data section");
  EXPECT_EQ(problem_with(find(0x03) + 15, 'z'),
            "byte 297: record \"schema\": it differs from an earlier one with the same id");
  EXPECT_EQ(problem_with(find(0x0B) + 9, 2),
            "byte 360: record \"statistics\": it counts other things than the file contains");
  EXPECT_EQ(problem_with(find(0x08) + 25, 30),
            "byte 425: record \"chunk index\": there is no such chunk where it points");
  EXPECT_EQ(problem_with(find(0x0A) + 17, 52),
            "byte 508: record \"attachment index\": there is no such attachment where it points");
  EXPECT_EQ(problem_with(find(0x02) + 9, 0),
            "byte 755: record \"footer\": it does not say where the summary is");
  EXPECT_EQ(problem_with(file.size() - 1, 0), "byte 784: the file does not end with its end mark");
  EXPECT_EQ(problem_with(0, 0), "byte 0: this is not an MCAP file of version 0");
}

TEST(McapReader, BytesBehindTheEndMarkAreNoticed) {
  Bytes file = tiny_file();
  file.push_back(std::byte{0});
  const Contents contents = read_all(file);
  ASSERT_TRUE(contents.problem);
  EXPECT_EQ(contents.problem->kind, Kind::kDamaged);
}

// Catches: a message whose length overflows the int that protobuf takes, which ends the program.
TEST(McapReader, REC_09_AMessageMayHave64MiBAndNoMore) {
  constexpr std::size_t kMost = (std::size_t{64} << 20) - mcap::kMessageHead;
  for (const std::size_t size : {kMost, kMost + 1}) {
    Bytes file;
    McapWriter writer(append_to(file), {.profile = "", .library = ""});
    writer.add_message({.channel = writer.add_channel("t", 0, "")}, Bytes(size));
    writer.finish();
    McapReader reader(file);
    McapMessage message;
    EXPECT_EQ(reader.next(message), size == kMost) << size;
    EXPECT_EQ(reader.problem().has_value(), size != kMost) << size;
    if (!reader.problem()) continue;
    EXPECT_TRUE(reader.problem()->what.ends_with("it is longer than 64 MiB")) << reader.problem()->what;
  }
}

// Catches: compressed bytes taken for records.
TEST(McapReader, CompressedChunkIsRefusedByName) {
  mcap::Buffer file;
  file.put_bytes(bytes_of(mcap::kMagic));
  const auto header = file.begin_record(mcap::Opcode::kHeader);
  file.put_string("");
  file.put_string("");
  file.end_record(header);
  const auto chunk = file.begin_record(mcap::Opcode::kChunk);
  for (int i = 0; i < 3; ++i)
    file.put(std::uint64_t{3});
  file.put(std::uint32_t{0});
  file.put_string("zstd");
  file.put(std::uint64_t{1});
  file.put_bytes(bytes_of("?"));
  file.end_record(chunk);
  const Contents contents = read_all(file.bytes());
  ASSERT_TRUE(contents.problem);
  EXPECT_EQ(contents.problem->kind, Kind::kUnsupported);
  EXPECT_EQ(contents.problem->what,
            "byte 25: a chunk is compressed with \"zstd\"; only uncompressed recordings can be read");
}

}  // namespace
}  // namespace drivebench::mcap_test
