#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/formats/candump.hpp"
#include "protocols/can/formats/slcan.hpp"
#include "protocols/can/formats/socketcand.hpp"
#include "tests/protocols/can/can_frames.hpp"

namespace drivebench::can::can_formats_test {
namespace {

// ---- slcan ----

std::string slcan(const Frame& frame) {
  std::string line;
  append_slcan(line, frame);
  return line;
}

// Catches: identifiers without leading zeros, sizes that are not length codes, data in a remote frame.
TEST(CanSlcan, WritesTheLinesOfAdapters) {
  EXPECT_EQ(slcan(kShort), "t1233010203\r");
  EXPECT_EQ(slcan(kRemote), "R18DAF1104\r");
  EXPECT_EQ(slcan({.id = 5, .extended = true, .size = 1, .data = {0xAB}}), "T000000051AB\r");
  EXPECT_EQ(slcan({.id = 5, .remote = true, .size = 8}), "r0058\r");
  EXPECT_EQ(slcan(kFd), "b7FF9000102030405060708090A0B\r");
  EXPECT_EQ(slcan({.id = 1, .extended = true, .fd = true}), "D000000010\r");
  EXPECT_EQ(slcan({.error = true}), "");
  std::string stamped;
  append_slcan(stamped, kShort, 0xEA5F);
  EXPECT_EQ(stamped, "t1233010203EA5F\r");
}

// Catches: a letter that is read as another one.
TEST(CanSlcan, CarriesEveryFrame) {
  std::mt19937 random(2);
  for (int i = 0; i < 2000; ++i) {
    const Frame frame = any_frame(random);
    std::string line;
    append_slcan(line, frame, i % 2 == 0 ? std::optional<std::uint16_t>(i) : std::nullopt);
    ASSERT_LE(line.size() - 1, kMaxSlcanLine);
    line.pop_back();
    ASSERT_EQ(parse_slcan(line), frame) << line;
  }
}

// Catches: lines that are nearly right taken for frames.
TEST(CanSlcan, RefusesLinesThatAreNoFrame) {
  EXPECT_NE(parse_slcan("t12321122"), std::nullopt);
  EXPECT_NE(parse_slcan("t1232aAbB"), std::nullopt) << "small letters are common";
  for (const std::string_view line :
       {"",        "t",          "t12",          "t123",    "t1239112233445566778899",
        "t12321",  "t1232112",   "t12321122334", "t8001AA", "T200000000",
        "T12",     "t 230",      "t-230",        "t0x30",   "x1230",
        "t1231G0", "r123111",    "d123GFF",      "O",       "S8",
        "t12301",  "t123100EA5", "t123100EA5G"})
    EXPECT_EQ(parse_slcan(line), std::nullopt) << line;
}

// Catches: a reader that depends on how the stream was cut, mixes up refusals, or grows.
TEST(CanSlcan, CutsAStreamIntoLines) {
  SlcanReader reader;
  std::vector<std::string> lines;
  const std::string stream = "O\r\r\nt12300\a" + std::string(10'000, 'x') + "\rV\r";
  for (const char byte : stream) {
    if (const auto line = reader.push(byte)) {
      lines.push_back(std::string(line->text.substr(0, 8)) + (line->refusal ? "!" : "") +
                      (line->too_long ? "..." : ""));
    }
  }
  EXPECT_EQ(lines, (std::vector<std::string>{"O", "", "t12300!", "xxxxxxxx...", "V"}));
}

// Catches: an adapter that is set to another bit rate than the bench.
TEST(CanSlcan, HasTheBitRatesOfAdapters) {
  EXPECT_EQ(slcan_bit_rate(1'000'000), "S8");
  EXPECT_EQ(slcan_bit_rate(125'000), "S4");
  EXPECT_EQ(slcan_bit_rate(800'000), std::nullopt);
  EXPECT_EQ(slcan_data_bit_rate(5'000'000), "Y5");
  EXPECT_EQ(slcan_data_bit_rate(8'000'000), std::nullopt);
}

// ---- socketcand ----

std::string to_client(const Frame& frame) {
  std::string text;
  append_socketcand_frame(text, frame, 23.424242);
  return text;
}

std::string to_server(const Frame& frame) {
  std::string text;
  append_socketcand_send(text, frame);
  return text;
}

std::string_view inside(std::string_view element) {
  return element.substr(2, element.size() - 4);
}

// Catches: another spelling than socketcand's, which clients compare with.
TEST(CanSocketcand, WritesTheElementsOfSocketcand) {
  EXPECT_EQ(to_client(kShort), "< frame 123 23.424242 010203 >");
  EXPECT_EQ(to_client({.id = 0x7F}), "< frame 07F 23.424242  >");
  EXPECT_EQ(to_client({.id = 0x7F, .extended = true}), "< frame 0000007F 23.424242  >");
  EXPECT_EQ(to_client(kRemote), "< rtr 18DAF110 23.424242 4 >");
  EXPECT_EQ(to_client(kFd), "< fdframe 7FF 03 23.424242 000102030405060708090A0B >");
  EXPECT_EQ(to_client({.id = 4, .error = true}), "< error 004 23.424242 >");
  EXPECT_EQ(to_server(kShort), "< send 123 3 01 02 03 >");
  EXPECT_EQ(to_server(kRemote), "< sendrtr 18DAF110 4 >");
  EXPECT_EQ(to_server({.id = 1, .extended = true, .fd = true, .size = 1, .data = {0xFE}}),
            "< fdsend 00000001 00 1 FE >");
}

// Catches: a word that only one of the two directions knows.
TEST(CanSocketcand, CarriesEveryFrame) {
  std::mt19937 random(3);
  for (int i = 0; i < 2000; ++i) {
    const Frame frame = any_frame(random);
    const auto back = parse_socketcand_frame(inside(to_client(frame)));
    ASSERT_TRUE(back) << to_client(frame);
    ASSERT_EQ(back->frame, frame);
    ASSERT_DOUBLE_EQ(back->time_s, 23.424242);
    ASSERT_EQ(parse_socketcand_send(inside(to_server(frame))), frame) << to_server(frame);
    ASSERT_LT(to_server(frame).size(), kMaxSocketcandElement);
    ASSERT_LT(to_client(frame).size(), kMaxSocketcandElement);
  }
}

// Catches: elements of real clients that are refused or read as other frames.
TEST(CanSocketcand, ReadsElementsOfRealClients) {
  const Frame extended{.id = 0x12345, .extended = true, .size = 2, .data = {1, 0xF1}};
  EXPECT_EQ(parse_socketcand_send("send 00012345 2 1 F1"), extended);
  EXPECT_EQ(parse_socketcand_send("send 12345 2 1 f1"), extended) << "python-can 4.1.0";
  EXPECT_EQ(parse_socketcand_send("send 123 0 "), (Frame{.id = 0x123})) << "python-can without data";
  EXPECT_EQ(parse_socketcand_send("send 00000123 0"), (Frame{.id = 0x123, .extended = true}));
  EXPECT_EQ(parse_socketcand_send("send 80012345 2 1 fffffff1"), extended) << "SavvyCAN, 32 bits";
  EXPECT_EQ(parse_socketcand_send("send ffffffff80012345 2 1 fffffffffffffff1"), extended)
      << "SavvyCAN, 64 bits";
}

// Catches: elements that are nearly right taken for frames.
TEST(CanSocketcand, RefusesElementsThatAreNoFrame) {
  for (const std::string_view element : {"",
                                         "send",
                                         "send 123",
                                         "send 123 1",
                                         "send 123 1 100",
                                         "send 123 1 1 2",
                                         "send 123 9 1 2 3 4 5 6 7 8 9",
                                         "send 12G 0",
                                         "send 20000000 0",
                                         "send 100000000 0",
                                         "send A0000000 0",
                                         "send 123 -1",
                                         "send 0x123 0",
                                         "sendrtr 123 9",
                                         "sendrtr 123 0 1",
                                         "fdsend 123 08 0",
                                         "fdsend 123 00 9 1 2 3 4 5 6 7 8 9",
                                         "fdsend 123 00 65",
                                         "send 123 1 7fffff80",
                                         "frame 123 1.000000 "})
    EXPECT_EQ(parse_socketcand_send(element), std::nullopt) << element;
  for (const std::string_view element :
       {"frame 123", "frame 123 1.0 00", "frame 123 -1.000000 00", "frame 123 1.000000 0",
        "frame 123 1.000000 00 00", "frame 123 nan 00", "frame 123 1.000000 000102030405060708",
        "rtr 123 1.000000", "send 123 0"})
    EXPECT_FALSE(parse_socketcand_frame(element)) << element;
}

// Catches: a reader that depends on how the stream was cut, that grows, or that takes rubbish for a part of
// an element.
TEST(CanSocketcand, CutsAStreamIntoElements) {
  SocketcandReader reader;
  std::vector<std::string> elements;
  const std::string stream = "< hi ><ok>\n <  a  b > x <c><" + std::string(10'000, 'd') + "> < e < f >< g >";
  for (const char byte : stream) {
    if (const auto element = reader.push(byte))
      elements.push_back(element->bad ? "bad" : std::string(element->text));
  }
  EXPECT_EQ(elements, (std::vector<std::string>{"hi", "ok", "a  b", "bad", "bad", "bad", "g"}));
}

// ---- candump ----

std::string candump(double time_s, const Frame& frame) {
  std::string line;
  append_candump(line, time_s, "vcan0", frame);
  return line;
}

// Catches: another format than can-utils'.
TEST(CanCandump, WritesTheLogFormat) {
  EXPECT_EQ(candump(1436509052.249713, {.id = 0x44, .size = 5, .data = {0x2A, 0x36, 0x6C, 0x2B, 0xBA}}),
            "(1436509052.249713) vcan0 044#2A366C2BBA\n");
  EXPECT_EQ(candump(0.0, kRemote), "(0.000000) vcan0 18DAF110#R4\n");
  EXPECT_EQ(candump(0.5, {.id = 1, .remote = true}), "(0.500000) vcan0 001#R\n");
  EXPECT_EQ(candump(1e-6, kFd), "(0.000001) vcan0 7FF##3000102030405060708090A0B\n");
  EXPECT_EQ(candump(0.9999999, {.id = 1, .extended = true}), "(1.000000) vcan0 00000001#\n");
  EXPECT_EQ(candump(0.0, {.id = 4, .error = true, .size = 8}),
            "(0.000000) vcan0 20000004#0000000000000000\n");
}

}  // namespace
}  // namespace drivebench::can::can_formats_test
