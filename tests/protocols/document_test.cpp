
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "bench.pb.h"
#include "protocols/text.hpp"

namespace drivebench::document_test {
namespace {

// Catches: a character that is cut in two; one that fits and is left out.
TEST(Document, TextIsCutBetweenCharacters) {
  const std::string text = "a\u00e4\u20ac\U0001f600z";  // 1, 2, 3, 4 and 1 bytes
  std::size_t whole = 0;
  for (std::size_t most = 0; most <= text.size() + 1; ++most) {
    for (const std::size_t end : {1u, 3u, 6u, 10u, 11u})
      if (end <= most) whole = end;
    EXPECT_EQ(utf8(text, most), text.substr(0, whole)) << most;
  }
  EXPECT_EQ(utf8(text), text);
}

// Catches: bytes that protobuf refuses as text, be it only at the end.
TEST(Document, BytesThatAreNoTextBecomeQuestionMarks) {
  EXPECT_EQ(utf8("a\xff"
                 "b"),
            "a?b");
  EXPECT_EQ(utf8("\xe2\x82"), "??") << "the end of a character is missing";
  EXPECT_EQ(utf8("\x82\xac"), "??") << "the beginning is";
  EXPECT_EQ(utf8("\xc0\xaf \xe0\x80\xaf \xf0\x80\x80\xaf"), "?? ??? ????") << "longer than need be";
  EXPECT_EQ(utf8("\xed\xa0\x80 \xf4\x90\x80\x80"), "??? ????") << "half a pair, and beyond the last";
  EXPECT_EQ(utf8("\xed\x9f\xbf\xf4\x8f\xbf\xbf"), "\ud7ff\U0010ffff") << "those just before";
}

// Catches: any other text that protobuf refuses.
TEST(Document, AnyBytesBecomeTextThatProtobufTakes) {
  std::mt19937 random(7);
  const std::string bytes = "a\x7f\x80\x8f\x90\x9f\xa0\xbf\xc1\xc2\xdf\xe0\xe1\xed\xef\xf0\xf1\xf4\xf5\xff";
  int unchanged = 0;
  for (int n = 0; n < 100'000; ++n) {
    std::string text(1 + random() % 6, '\0');
    std::ranges::generate(text, [&] { return bytes[random() % bytes.size()]; });
    v1::Hello hello;
    hello.set_client(utf8(text));
    ASSERT_TRUE(v1::Hello().ParseFromString(hello.SerializeAsString())) << n;
    hello.set_client(utf8(text, random() % text.size()));
    ASSERT_TRUE(v1::Hello().ParseFromString(hello.SerializeAsString())) << n;
    unchanged += utf8(text) == text ? 1 : 0;
  }
  EXPECT_GT(unchanged, 1000);
}

// Catches: a printed text that breaks the line, moves the terminal's cursor or turns the direction of
// writing, so that a name looks like another; a letter of a language from right to left that is lost; a text
// without an end.
TEST(Document, APrintedTextIsOneLine) {
  EXPECT_EQ(printable("a\n\x1b[2J\x7f\u00e4"), "a??[2J?\u00e4");
  EXPECT_EQ(printable("\u009b2J\u202eanna\u2066\u200f\u061c\u2028"), "?2J?anna????");
  EXPECT_EQ(printable("\u00a0\u05d0\u0627\u2019\u202f\U0001f600"),
            "\u00a0\u05d0\u0627\u2019\u202f\U0001f600");
  EXPECT_EQ(printable(std::string(160, 'x')), std::string(160, 'x'));
  EXPECT_EQ(printable(std::string(161, 'x')), std::string(160, 'x') + "...");
}

}  // namespace
}  // namespace drivebench::document_test
