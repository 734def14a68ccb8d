#include "protocols/framing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace drivebench::framing_test {
namespace {

using Bytes = std::vector<std::byte>;

Bytes frame(std::size_t size, unsigned fill = 0x5a) {
  const auto header = frame_header(static_cast<std::uint32_t>(size));
  Bytes bytes(header.begin(), header.end());
  bytes.resize(kFrameHeaderSize + size, std::byte(fill));
  return bytes;
}

Bytes header_of(std::uint32_t length) {
  const auto header = frame_header(length);
  return {header.begin(), header.end()};
}

/// Hands bytes over in pieces of a size, and collects the frames that come out.
struct Stream {
  explicit Stream(std::size_t capacity) : reader(capacity) {}

  void feed(std::span<const std::byte> bytes) {
    while (!bytes.empty() && reader.error().empty()) {
      const std::span<std::byte> space = reader.free_space();
      ASSERT_FALSE(space.empty()) << "the stream is stuck";
      const std::size_t count = std::min(space.size(), bytes.size());
      std::copy_n(bytes.begin(), count, space.begin());
      reader.received(count);
      bytes = bytes.subspan(count);
      while (const auto payload = reader.next())
        frames.emplace_back(payload->begin(), payload->end());
    }
  }

  FrameReader reader;
  std::vector<Bytes> frames;
};

// Catches: a length in the wrong byte order.
TEST(Framing, LengthIsFourBytesBigEndian) {
  const Bytes expected{std::byte{0x01}, std::byte{0x02}, std::byte{0xfe}, std::byte{0xff}};
  EXPECT_EQ(header_of(0x0102feff), expected);
}

// Catches: an off-by-one at either end of the allowed lengths. TCP-01.
TEST(Framing, TCP_01_LIMIT_01_OneAndMaxPassZeroAndMaxPlusOneDoNot) {
  for (const std::size_t good : {std::size_t{1}, std::size_t{2}, std::size_t{100}}) {
    Stream stream(100);
    stream.feed(frame(good));
    ASSERT_EQ(stream.frames.size(), 1u) << good;
    EXPECT_EQ(stream.frames[0].size(), good);
    EXPECT_TRUE(stream.reader.error().empty());
  }
  for (const std::uint32_t bad : {0u, 101u, 0x7fff'ffffu, 0x8000'0000u, 0xffff'fffcu, 0xffff'ffffu}) {
    Stream stream(100);
    stream.feed(header_of(bad));
    EXPECT_TRUE(stream.frames.empty());
    EXPECT_FALSE(stream.reader.error().empty()) << bad;
  }
}

// Catches: a cap that is checked only when the frame is whole, a cap that cannot be raised, or one raised
// beyond the buffer.
TEST(Framing, CapMayBeLoweredAndRaisedWithinTheCapacity) {
  Stream stream(100);
  stream.reader.set_max_payload(10);
  stream.feed(frame(10));
  stream.reader.set_max_payload(1000);
  stream.feed(frame(100));
  EXPECT_EQ(stream.frames.size(), 2u);
  stream.feed(header_of(101));
  EXPECT_FALSE(stream.reader.error().empty());

  Stream lowered(100);
  lowered.reader.set_max_payload(10);
  lowered.feed(header_of(11));
  EXPECT_FALSE(lowered.reader.error().empty());
}

// Catches: memory for the largest frame for each client that has not said hello; bytes that are lost when the
// buffer grows.
TEST(Framing, LIMIT_01_TheBufferGrowsWithTheLimit) {
  Stream stream(1000);
  stream.reader.set_max_payload(10);
  EXPECT_EQ(stream.reader.free_space().size(), kFrameHeaderSize + 10);
  const Bytes small = frame(10, 1);
  const Bytes large = frame(1000, 2);
  Bytes bytes = small;
  bytes.insert(bytes.end(), large.begin(), large.begin() + 3);
  stream.feed(bytes);
  stream.reader.set_max_payload(1000);
  stream.feed(std::span(large).subspan(3));
  ASSERT_EQ(stream.frames.size(), 2u);
  EXPECT_EQ(stream.frames[1], Bytes(large.begin() + kFrameHeaderSize, large.end()));
}

// Catches: a reader that goes on with a stream behind a bad length.
TEST(Framing, NothingFollowsABadLength) {
  Stream stream(100);
  Bytes bytes = frame(3);
  const Bytes bad = header_of(0);
  const Bytes good = frame(4);
  bytes.insert(bytes.end(), bad.begin(), bad.end());
  bytes.insert(bytes.end(), good.begin(), good.end());
  stream.feed(bytes);
  EXPECT_EQ(stream.frames.size(), 1u);
  EXPECT_EQ(stream.reader.next(), std::nullopt);
  EXPECT_FALSE(stream.reader.error().empty());
}

Bytes three_frames() {
  Bytes bytes;
  for (const auto& [size, fill] : {std::pair{1u, 1u}, {20u, 2u}, {7u, 3u}}) {
    const Bytes one = frame(size, fill);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  return bytes;
}

void expect_three(const Stream& stream) {
  ASSERT_EQ(stream.frames.size(), 3u);
  EXPECT_EQ(stream.frames[0], Bytes(1, std::byte{1}));
  EXPECT_EQ(stream.frames[1], Bytes(20, std::byte{2}));
  EXPECT_EQ(stream.frames[2], Bytes(7, std::byte{3}));
}

// Catches: a reader that takes the bytes of one read for a frame. TCP-03.
TEST(Framing, TCP_03_OneByteAtATimeGivesTheSameFrames) {
  const Bytes bytes = three_frames();
  Stream stream(20);
  for (const std::byte& byte : bytes)
    stream.feed({&byte, 1});
  expect_three(stream);
}

// Catches: a reader that fails when a header or payload lies across two reads.
TEST(Framing, TCP_03_EverySplitGivesTheSameFrames) {
  const Bytes bytes = three_frames();
  for (std::size_t first = 0; first <= bytes.size(); ++first) {
    for (std::size_t second = first; second <= bytes.size(); ++second) {
      Stream stream(20);
      stream.feed(std::span(bytes).first(first));
      stream.feed(std::span(bytes).subspan(first, second - first));
      stream.feed(std::span(bytes).subspan(second));
      expect_three(stream);
    }
  }
}

// Catches: bytes lost or doubled when the buffer is moved to its front; long runs in random pieces.
TEST(Framing, LongStreamsInRandomPiecesComeOutWhole) {
  std::mt19937 random(20'260'101);
  Bytes bytes;
  std::vector<Bytes> expected;
  for (unsigned i = 0; i < 2000; ++i) {
    const Bytes one = frame(1 + random() % 64, i);
    bytes.insert(bytes.end(), one.begin(), one.end());
    expected.emplace_back(one.begin() + kFrameHeaderSize, one.end());
  }
  Stream stream(64);
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t count = std::min<std::size_t>(1 + random() % 200, bytes.size() - at);
    stream.feed(std::span(bytes).subspan(at, count));
    at += count;
  }
  EXPECT_EQ(stream.frames, expected);
}

}  // namespace
}  // namespace drivebench::framing_test
