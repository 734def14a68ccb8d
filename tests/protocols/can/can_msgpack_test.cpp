#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "protocols/can/formats/msgpack.hpp"
#include "tests/protocols/can/can_frames.hpp"

namespace drivebench::can::can_msgpack_test {
namespace {

using namespace std::string_literals;

// The bytes of python-can 4.1.0 for these frames.
const std::string kShortPacked =
    "\x8b\xa9timestamp\xcb\x41\xd5g\xd8\xdf\x0f\xfbL\xae"
    "arbitration_id\xcd\x01#\xaeis_extended_id\xc2"
    "\xafis_remote_frame\xc2\xaeis_error_frame\xc2\xa7"
    "channel\xc0\xa3"
    "dlc\x03\xa4"
    "data\xc4\x03\x01\x02\x03\xa5is_fd\xc2\xae"
    "bitrate_switch\xc2\xb5"
    "error_state_indicator\xc2"s;
const std::string kRemotePacked =
    "\x8b\xa9timestamp\xcb\0\0\0\0\0\0\0\0\xae"
    "arbitration_id\xce\x18\xda\xf1\x10\xaeis_extended_id\xc3"
    "\xafis_remote_frame\xc3\xaeis_error_frame\xc2\xa7"
    "channel\xc0\xa3"
    "dlc\x04\xa4"
    "data\xc4\0\xa5is_fd\xc2\xae"
    "bitrate_switch\xc2\xb5"
    "error_state_indicator\xc2"s;
const std::string kFdPackedOnAChannel =
    "\x8b\xa9timestamp\xcb?\xf8\0\0\0\0\0\0\xae"
    "arbitration_id\xcd\x07\xff\xaeis_extended_id\xc2"
    "\xafis_remote_frame\xc2\xaeis_error_frame\xc2\xa7"
    "channel\xa5vcan0\xa3"
    "dlc\x0c\xa4"
    "data\xc4\x0c\0\x01\x02\x03\x04\x05\x06\x07\x08\t\n\x0b\xa5is_fd\xc3\xae"
    "bitrate_switch\xc3\xb5"
    "error_state_indicator\xc3"s;

std::optional<Frame> unpack(const std::string& bytes) {
  // A copy of just this size, so that the sanitizers see every step outside.
  const std::vector<char> copy(bytes.begin(), bytes.end());
  return decode_msgpack(std::as_bytes(std::span(copy)));
}

std::string pack(const Frame& frame, double time_s) {
  std::string bytes(kMaxMsgpackFrame, '\0');
  bytes.resize(encode_msgpack(frame, time_s, std::as_writable_bytes(std::span(bytes))));
  return bytes;
}

std::string key(const std::string& name) {
  return static_cast<char>(0xa0 + name.size()) + name;
}

// Catches: a map that is not byte for byte python-can's.
TEST(CanMsgpack, WritesTheBytesOfPythonCan) {
  EXPECT_EQ(pack(kShort, 1436509052.249713), kShortPacked);
  EXPECT_EQ(pack(kRemote, 0.0), kRemotePacked);
}

// Catches: two mixed-up keys, a channel that disturbs, an extended identifier read as a standard one.
TEST(CanMsgpack, ReadsTheBytesOfPythonCan) {
  EXPECT_EQ(unpack(kShortPacked), kShort);
  EXPECT_EQ(unpack(kRemotePacked), kRemote);
  EXPECT_EQ(unpack(kFdPackedOnAChannel), kFd);
}

// Catches: a field that only one of the two directions knows; a buffer that is too small.
TEST(CanMsgpack, CarriesEveryFrame) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; ++i) {
    const Frame frame = any_frame(random);
    const std::string packed = pack(frame, 1e9);
    ASSERT_FALSE(packed.empty());
    ASSERT_EQ(unpack(packed), frame);
  }
  std::vector<std::byte> small(kMaxMsgpackFrame - 1);
  EXPECT_EQ(encode_msgpack(kShort, 0.0, small), 0u);
}

// Catches: a decoder that expects one order of keys, or fails on the keys of a newer python-can.
TEST(CanMsgpack, TakesAnyOrderUnknownKeysAndWideNumbers) {
  const std::string nested = "\x82\xa1x\x92\x01\xc0\xa1y\x81\xa1z\xd6\x01\x01\x02\x03\x04"s;
  const std::string bytes = "\x87"s + key("data") + "\xc5\0\x02\x0a\x0b"s + key("is_rx") + "\xc3" +
                            key("is_extended_id") + "\x00"s + key("later") + nested + key("dlc") +
                            "\xcf\0\0\0\0\0\0\0\x02"s + key("timestamp") + "\x05" + key("arbitration_id") +
                            "\xd2\0\0\x01\x23"s;
  EXPECT_EQ(unpack(bytes), (Frame{.id = 0x123, .size = 2, .data = {10, 11}}));
}

// Catches: other defaults than python-can's, which takes an identifier for extended by default.
TEST(CanMsgpack, HasTheDefaultsOfPythonCan) {
  EXPECT_EQ(unpack("\x81" + key("arbitration_id") + "\x07"), (Frame{.id = 7, .extended = true}));
  EXPECT_EQ(unpack("\x80"), std::nullopt);
}

// Catches: a decoder that takes frames which no bus can carry.
TEST(CanMsgpack, RefusesImpossibleFrames) {
  const std::string standard = key("is_extended_id") + "\xc2";
  const auto with_id = [&](const std::string& id, int count, const std::string& more = "") {
    return static_cast<char>(0x80 + count) + key("arbitration_id") + id + more;
  };
  EXPECT_NE(unpack(with_id("\xce\x1f\xff\xff\xff", 1)), std::nullopt);
  EXPECT_EQ(unpack(with_id("\xce\x20\0\0\0"s, 1)), std::nullopt) << "29 bits";
  EXPECT_NE(unpack(with_id("\xcd\x07\xff", 2, standard)), std::nullopt);
  EXPECT_EQ(unpack(with_id("\xcd\x08\0"s, 2, standard)), std::nullopt) << "11 bits";
  EXPECT_EQ(unpack(with_id("\xff", 1)), std::nullopt) << "minus one";
  EXPECT_EQ(unpack(with_id("\xd0\x80", 1)), std::nullopt) << "negative";
  EXPECT_EQ(unpack(with_id("\x01", 2, key("dlc") + "\x02")), std::nullopt) << "less data than it says";
  EXPECT_EQ(unpack(with_id("\x01", 2, key("data") + "\xc4\x09" + "123456789")), std::nullopt) << "classic";
  EXPECT_EQ(unpack(with_id("\x01", 3, key("data") + "\xc4\x09" + "123456789" + key("is_fd") + "\xc3")),
            std::nullopt)
      << "no size of FD";
  EXPECT_EQ(unpack(with_id("\x01", 2, key("bitrate_switch") + "\xc3")), std::nullopt) << "classic";
  EXPECT_EQ(unpack(with_id("\x01", 3, key("is_remote_frame") + "\xc3" + key("is_fd") + "\xc3")),
            std::nullopt);
  EXPECT_EQ(unpack(with_id("\x01", 2, key("data") + "\xa2hi")), std::nullopt) << "text";
  EXPECT_EQ(unpack(with_id("\x01", 2, key("is_fd") + "\x02")), std::nullopt) << "no flag";
}

// Catches: a read behind the end, and bytes behind a map that are passed over in silence.
TEST(CanMsgpack, RefusesEveryPartOfAFrame) {
  for (std::size_t size = 0; size < kFdPackedOnAChannel.size(); ++size)
    EXPECT_EQ(unpack(kFdPackedOnAChannel.substr(0, size)), std::nullopt) << size;
  EXPECT_EQ(unpack(kFdPackedOnAChannel + "\xc0"), std::nullopt);
}

// Catches: nesting that costs stack, and counts that promise more values than there are bytes.
TEST(CanMsgpack, RefusesDeepAndEndlessValues) {
  EXPECT_EQ(unpack("\x81" + key("x") + std::string(60000, '\x91')), std::nullopt);
  EXPECT_EQ(unpack("\x81" + key("x") + "\xdd\xff\xff\xff\xff"), std::nullopt);
  EXPECT_EQ(unpack("\xdf\xff\xff\xff\xff"), std::nullopt);
  EXPECT_EQ(unpack("\x81" + key("x") + "\xc6\xff\xff\xff\xff"), std::nullopt);
}

}  // namespace
}  // namespace drivebench::can::can_msgpack_test
