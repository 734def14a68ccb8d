#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <string_view>

#include "protocols/mcap/mcap.hpp"
#include "tests/protocols/mcap/mcap_test_files.hpp"

namespace drivebench::mcap_test {
namespace {

std::string hex(std::span<const std::byte> bytes) {
  static constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    text += kDigits[std::to_integer<std::size_t>(byte >> 4)];
    text += kDigits[std::to_integer<std::size_t>(byte & std::byte{15})];
  }
  return text;
}

// Catches: any field in the wrong place, order, width or byte order, a wrong offset or checksum. The bytes
// were put together from the published format by a program that shares nothing with the writer.
TEST(McapWriter, TinyFileHasExactlyTheBytesOfTheFormat) {
  const std::string schema = "03110000000000000001000100000073010000006501000000fe";
  const std::string channel = "041c00000000000000000001000100000074010000006d0a000000010000006b0100000076";
  const std::string expected =
      "894d434150300d0a"                            // magic
      "010c000000000000000100000070030000006c6962"  // header
      // chunk: times, size, CRC32, no compression, size
      "068800000000000000080706050403020108070605040302016000000000000000944a55d4000000006000000000000000" +
      schema + channel +
      "05180000000000000000000700000008070605040302011817161514131211aabb"  // message
      "07160000000000000000001000000008070605040302013f00000000000000"      // message index
      "092a0000000000000009000000000000000000000000000000010000006103000000782f790200000000000000010274dae612"
      "0c1300000000000000010000006e0a000000010000006b0100000076"  // metadata
      "0f0400000000000000663a3e56" +                              // data end
      schema +
      channel +
      "0b38000000000000000100000000000000010001000000010000000100000001000000"  // statistics
      "080706050403020108070605040302010a00000000000100000000000000"
      "084a00000000000000080706050403020108070605040302011d000000000000009100000000000000"  // chunk index
      "0a0000000000ae000000000000001f000000000000000000000060000000000000006000000000000000"
      "0a3400000000000000cd0000000000000033000000000000000900000000000000000000000000000002000000000000"
      "00010000006103000000782f79"                                    // attachment index
      "0d150000000000000000010000000000001c00000000000000010000006e"  // metadata index
      "0e11000000000000000329010000000000001a00000000000000"          // summary offsets
      "0e11000000000000000443010000000000002500000000000000"
      "0e11000000000000000b68010000000000004100000000000000"
      "0e110000000000000008a9010000000000005300000000000000"
      "0e11000000000000000afc010000000000003d00000000000000"
      "0e11000000000000000d39020000000000001e00000000000000"
      "02140000000000000029010000000000005702000000000000b380ba2f"  // footer
      "894d434150300d0a";
  EXPECT_EQ(hex(tiny_file()), expected);
}

// Catches: a field read from the wrong place, a record kind that is skipped.
TEST(McapReader, ReadsEveryKindOfRecord) {
  const Bytes file = tiny_file();
  McapReader reader(file);
  EXPECT_EQ(reader.profile(), "p");
  EXPECT_EQ(reader.library(), "lib");
  McapMessage message;
  ASSERT_TRUE(reader.next(message));
  EXPECT_EQ(message.header.channel, 0);
  EXPECT_EQ(message.header.sequence, 7U);
  EXPECT_EQ(message.header.log_time_ns, 0x0102030405060708U);
  EXPECT_EQ(message.header.publish_time_ns, 0x1112131415161718U);
  EXPECT_EQ(text_of(message.payload), "\xaa\xbb");
  EXPECT_FALSE(reader.next(message));
  EXPECT_FALSE(reader.next(message));
  EXPECT_FALSE(reader.problem());
  EXPECT_EQ(reader.schemas().at(1), (McapSchema{.id = 1, .name = "s", .encoding = "e", .data = "\xfe"}));
  EXPECT_EQ(reader.channels().at(0),
            (McapChannel{
                .id = 0, .schema_id = 1, .topic = "t", .message_encoding = "m", .metadata = {{"k", "v"}}}));
  ASSERT_EQ(reader.attachments().size(), 1U);
  const McapAttachment& attachment = reader.attachments()[0];
  EXPECT_EQ(attachment.name, "a");
  EXPECT_EQ(attachment.media_type, "x/y");
  EXPECT_EQ(attachment.log_time_ns, 9U);
  EXPECT_EQ(text_of(attachment.data), "\x01\x02");
  ASSERT_EQ(reader.metadata().size(), 1U);
  EXPECT_EQ(reader.metadata()[0].name, "n");
  EXPECT_EQ(reader.metadata()[0].entries, (McapMapView{{"k", "v"}}));
}

// Catches: messages lost or reordered where a chunk ends, a channel that starts late, an empty payload, a
// payload longer than a chunk, counts per channel.
TEST(Mcap, MessagesSurviveManyChunks) {
  std::vector<Kept> written;
  const Bytes file = small_file(written);
  const Contents contents = read_all(file);
  EXPECT_FALSE(contents.problem) << contents.problem->what;
  EXPECT_EQ(contents.messages, written);

  McapReader reader(file);
  for (McapMessage message; reader.next(message);) {
  }
  for (std::uint16_t channel = 0; channel < 3; ++channel) {
    EXPECT_EQ(reader.message_count(channel),
              static_cast<std::uint64_t>(std::count_if(written.begin(), written.end(), [&](const Kept& kept) {
                return kept.header.channel == channel;
              })));
  }
  EXPECT_EQ(reader.message_count(3), 0U);
}

// Catches: index entries left over from the chunk before, offsets counted from the wrong place (the reader
// does not use them, others jump by them), chunks that never end.
TEST(McapWriter, EveryMessageIsIndexedOnceInChunksOfTheRequestedSize) {
  std::vector<Kept> written;
  const Bytes file = small_file(written);
  std::size_t records = 0;  // start of those of the current chunk
  std::size_t chunks = 0;
  std::size_t indexed = 0;
  for (const Place& place : places(file)) {
    const std::byte* at = file.data() + place.begin + 9;
    if (place.opcode == 0x06) {
      ++chunks;
      records = place.begin + 49;
      EXPECT_LT(place.end - records, 200U + 31 + 20) << "closed by the message that reaches 200";
    }
    if (place.opcode != 0x07) continue;
    const auto channel = mcap::load<std::uint16_t>(at);
    for (at += 6; at < file.data() + place.end; at += 16, ++indexed) {
      const std::byte* message = file.data() + records + mcap::load<std::uint64_t>(at + 8);
      ASSERT_LT(message, file.data() + place.begin);
      EXPECT_EQ(message[0], std::byte{0x05});
      EXPECT_EQ(mcap::load<std::uint16_t>(message + 9), channel);
      EXPECT_EQ(mcap::load<std::uint64_t>(message + 15), mcap::load<std::uint64_t>(at));
    }
  }
  EXPECT_EQ(indexed, written.size());
  EXPECT_GE(chunks, 4U);
}

TEST(Mcap, PayloadLongerThanAChunkSurvives) {
  Bytes file;
  McapWriter writer(append_to(file), {.profile = "", .library = "", .chunk_size = 100});
  const auto channel = writer.add_channel("t", 0, "");
  const std::string payload(10'000, 'x');
  writer.add_message({.channel = channel, .sequence = 0}, bytes_of(payload));
  writer.add_message({.channel = channel, .sequence = 1}, {});
  writer.finish();
  const Contents contents = read_all(file);
  EXPECT_FALSE(contents.problem) << contents.problem->what;
  ASSERT_EQ(contents.messages.size(), 2U);
  EXPECT_EQ(contents.messages[0].payload, payload);
  EXPECT_EQ(contents.messages[1].payload, "");
}

// Catches: an in-place message with its room instead of its size, a dropped message that leaves a trace.
TEST(Mcap, PayloadsEncodedInPlaceTakeTheirActualSize) {
  Bytes file;
  McapWriter writer(append_to(file), {});
  const auto channel = writer.add_channel("t", 0, "");
  const auto dropped = writer.begin_message({.channel = channel, .sequence = 1}, 100);
  std::memset(dropped.data(), 'd', dropped.size());
  const auto room = writer.begin_message({.channel = channel, .sequence = 2}, 1000);
  ASSERT_EQ(room.size(), 1000U);
  std::memcpy(room.data(), "four", 4);
  writer.end_message(4);
  writer.finish();
  const Contents contents = read_all(file);
  EXPECT_FALSE(contents.problem) << contents.problem->what;
  ASSERT_EQ(contents.messages.size(), 1U);
  EXPECT_EQ(contents.messages[0].header.sequence, 2U);
  EXPECT_EQ(contents.messages[0].payload, "four");
}

// Catches: a recording that cannot be read because its writer never finished it.
TEST(Mcap, FlushedMessagesAreReadableWithoutFinish) {
  Bytes file;
  McapWriter writer(append_to(file), {});
  const auto channel = writer.add_channel("t", writer.add_schema("s", "", {}), "m");
  writer.add_message({.channel = channel, .sequence = 1}, bytes_of("one"));
  writer.flush();
  const std::size_t flushed = file.size();
  writer.flush();
  writer.add_message({.channel = channel, .sequence = 2}, bytes_of("two"));
  EXPECT_EQ(file.size(), flushed) << "the second message belongs to a chunk that is still open";
  const Contents contents = read_all(file);
  ASSERT_EQ(contents.messages.size(), 1U);
  EXPECT_EQ(contents.messages[0].payload, "one");
  ASSERT_TRUE(contents.problem);
  EXPECT_EQ(contents.problem->kind, McapProblem::Kind::kTruncated);
  EXPECT_EQ(contents.problem->offset, flushed);
}

// Catches: a file without messages that the reader takes for damaged.
TEST(Mcap, FilesWithoutMessagesAreWhole) {
  Bytes nothing;
  McapWriter(append_to(nothing), {}).finish();
  EXPECT_FALSE(read_all(nothing).problem);

  Bytes channels_only;
  McapWriter writer(append_to(channels_only), {});
  writer.add_channel("t", 0, "m");
  writer.finish();
  McapReader reader(channels_only);
  McapMessage message;
  EXPECT_FALSE(reader.next(message));
  EXPECT_FALSE(reader.problem());
  EXPECT_EQ(reader.channels().size(), 1U);
}

// Catches: messages outside chunks refused or left out of the checksum, extension records that stop the
// reader.
TEST(McapReader, UnchunkedMessagesAndUnknownRecordsAreAccepted) {
  mcap::Buffer file;
  const auto add = [&file](std::uint8_t opcode, auto&& put_fields) {
    const auto begin = file.begin_record(static_cast<mcap::Opcode>(opcode));
    put_fields();
    file.end_record(begin);
  };
  file.put_bytes(bytes_of(mcap::kMagic));
  add(0x01, [&] { file.put_map({}), file.put_string("x"), file.put_string("a later field"); });
  add(0x80, [&] { file.put_string("private"); });
  add(0x04, [&] { file.put(std::uint32_t{3}), file.put_string(""), file.put_string(""), file.put_map({}); });
  add(0x05, [&] { file.put(std::uint16_t{3}), file.put(std::uint32_t{1}), file.put_bytes(Bytes(19)); });
  const std::uint32_t crc = mcap::crc32_of(0, file.bytes());
  add(0x0F, [&] { file.put(crc); });
  add(0x02, [&] { file.put_bytes(Bytes(20)); });
  file.put_bytes(bytes_of(mcap::kMagic));
  const Contents contents = read_all(file.bytes());
  EXPECT_FALSE(contents.problem) << contents.problem->what;
  ASSERT_EQ(contents.messages.size(), 1U);
  EXPECT_EQ(contents.messages[0].payload.size(), 3U);
}

// Catches: an offset or size kept in 16 or 24 bits, a buffer that grows wrongly, a checksum joined wrongly.
TEST(Mcap, LongRecordingSurvives) {
  constexpr std::uint32_t kMessages = 300'000;
  Bytes file;
  McapWriter writer(append_to(file), {});
  std::array<std::uint16_t, 10> channels{};
  for (auto& channel : channels)
    channel = writer.add_channel("t", 0, "");
  std::array<std::uint32_t, 40> payload{};
  for (std::uint32_t i = 0; i < kMessages; ++i) {
    payload.fill(i * 2'654'435'761U);
    writer.add_message({.channel = channels[i % 10], .sequence = i, .log_time_ns = i, .publish_time_ns = i},
                       std::as_bytes(std::span(payload)).first(i % 160));
  }
  writer.finish();
  EXPECT_EQ(writer.bytes_written(), file.size());
  EXPECT_GT(file.size(), std::size_t{20} << 20);

  McapReader reader(file);
  std::uint32_t next = 0;
  for (McapMessage message; reader.next(message); ++next) {
    payload.fill(next * 2'654'435'761U);
    ASSERT_EQ(message.header.sequence, next);
    ASSERT_EQ(message.header.channel, channels[next % 10]);
    ASSERT_EQ(message.payload.size(), next % 160);
    ASSERT_EQ(std::memcmp(message.payload.data(), payload.data(), next % 160), 0);
  }
  EXPECT_EQ(next, kMessages);
  EXPECT_FALSE(reader.problem()) << reader.problem()->what;
}

// Catches: a programmer's mistake that writes an unreadable file instead of stopping the program.
TEST(McapWriterDeathTest, WrongUseStopsTheProgram) {
  Bytes file;
  McapWriter writer(append_to(file), {});
  EXPECT_DEATH(writer.add_message({.channel = 0}, {}), "a message's channel is added before it");
  EXPECT_DEATH(writer.add_channel("t", 1, ""), "a channel's schema is added before it");
  EXPECT_DEATH(writer.end_message(0), "follows begin_message");
  const auto channel = writer.add_channel("t", 0, "");
  writer.begin_message({.channel = channel}, 3);
  EXPECT_DEATH(writer.end_message(4), "no longer than the room");
  writer.finish();
  EXPECT_DEATH(writer.add_message({.channel = channel}, {}), "after finish");
  EXPECT_DEATH(writer.finish(), "after finish");
}

}  // namespace
}  // namespace drivebench::mcap_test
