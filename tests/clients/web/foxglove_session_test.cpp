#include "clients/web/gateway/relays/foxglove_session.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace drivebench::web::foxglove_session_test {
namespace {

v1::Welcome welcome_with_axes(int count) {
  v1::Welcome welcome;
  welcome.mutable_bench()->set_period_s(125e-6);
  for (int i = 0; i < count; ++i)
    welcome.mutable_bench()->add_axes()->set_name("axis" + std::to_string(i));
  return welcome;
}

v1::Envelope samples_of(std::uint32_t axis, std::uint64_t first, std::uint64_t count, std::uint64_t dropped) {
  v1::Envelope envelope;
  envelope.mutable_samples()->set_axis(axis);
  envelope.mutable_samples()->set_dropped(dropped);
  for (std::uint64_t i = 0; i < count; ++i)
    envelope.mutable_samples()->add_samples()->set_tick(first + i);
  return envelope;
}

std::vector<FoxgloveMessage> taken(FoxgloveSession& session) {
  std::vector<FoxgloveMessage> messages;
  for (FoxgloveMessage message; session.next(message);)
    messages.push_back(message);
  return messages;
}

std::uint64_t count_of(const std::vector<FoxgloveMessage>& messages, char opcode) {
  std::uint64_t count = 0;
  for (const FoxgloveMessage& each : messages)
    if (!each.is_text && each.bytes[0] == opcode) ++count;
  return count;
}

// Catches: a subprotocol that only begins like Foxglove's, or is not found behind another one.
TEST(FoxgloveSession, TheSubprotocolIsTheFirstThatIsKnown) {
  EXPECT_EQ(foxglove_subprotocol("foxglove.websocket.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(foxglove_subprotocol("mqtt,\tfoxglove.sdk.v1 , foxglove.websocket.v1"), "foxglove.sdk.v1");
  for (const char* other : {"", " ", ",,", "foxglove.sdk.v10", "xfoxglove.sdk.v1", "foxglove.websocket.v2"})
    EXPECT_EQ(foxglove_subprotocol(other), "") << other;
}

// Catches: a message of another byte order, a time that is not that of a recording, and a time that goes back
// with the second axis.
TEST(FoxgloveSession, AMessageHasSubscriptionTimeAndSample) {
  FoxgloveSession session(welcome_with_axes(2));
  ASSERT_EQ(
      session.text(R"({"op":"subscribe","subscriptions":[{"id":258,"channelId":2},{"id":1,"channelId":1}]})")
          .size(),
      2u);
  taken(session);
  session.from_bench(samples_of(1, 8'000'000, 1, 0));  // 1000 s
  session.from_bench(samples_of(0, 7'999'999, 1, 0));
  const auto messages = taken(session);
  ASSERT_EQ(messages.size(), 3u);
  const std::string time("\x00\x10\xa5\xd4\xe8\x00\x00\x00", 8);
  EXPECT_EQ(messages[0].bytes.substr(0, 13), std::string("\x01\x02\x01\x00\x00", 5) + time);
  v1::Sample sample;
  ASSERT_TRUE(sample.ParseFromString(messages[0].bytes.substr(13)));
  EXPECT_EQ(sample.tick(), 8'000'000u);
  EXPECT_EQ(messages[1].bytes, "\x02" + time);
  EXPECT_EQ(messages[2].bytes[1], 1);
}

// Catches: a clock that stands still after a reset or a restored state, until the bench has passed its old
// time.
TEST(FoxgloveSession, TheClockIsSetBackWithTheBench) {
  FoxgloveSession session(welcome_with_axes(1));
  session.text(R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":1}]})");
  session.from_bench(samples_of(0, 8'000'000, 2, 0));
  taken(session);
  session.from_bench(samples_of(0, 1, 1, 0));
  const auto messages = taken(session);
  ASSERT_EQ(count_of(messages, 2), 1u);
  EXPECT_EQ(messages.back().bytes, "\x02" + messages.front().bytes.substr(5, 8));
}

// Catches: samples that a slow client loses without being told, or that are counted twice or for the other
// axis.
TEST(FoxgloveSession, WEB_06_ASlowClientIsToldHowManySamplesItLost) {
  FoxgloveSession session(welcome_with_axes(2));
  session.text(R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":1},{"id":1,"channelId":2}]})");
  taken(session);
  std::uint64_t sent = 0;
  for (; sent < 200'000; sent += 10)
    session.from_bench(samples_of(0, sent, 10, 0));
  EXPECT_FALSE(session.is_full());
  const std::uint64_t got = count_of(taken(session), 1);
  EXPECT_GT(got, 0u);
  EXPECT_LT(got, sent);
  session.from_bench(samples_of(0, sent, 1, 5));
  session.from_bench(samples_of(0, sent + 1, 1, 0));
  session.from_bench(samples_of(1, sent, 1, 0));
  const auto after = taken(session);
  ASSERT_TRUE(after[0].is_text);
  EXPECT_NE(after[0].bytes.find("/axis0/sample: " + std::to_string(sent - got + 5) + " samples are lost"),
            std::string::npos)
      << after[0].bytes;
  for (std::size_t i = 1; i < after.size(); ++i)
    EXPECT_FALSE(after[i].is_text) << after[i].bytes;
}

// Catches: a client that asks on and on without reading, and fills the memory with answers.
TEST(FoxgloveSession, WEB_06_AnswersThatNobodyTakesHaveALimit) {
  FoxgloveSession session(welcome_with_axes(1));
  taken(session);
  std::size_t answers = 0;
  for (; !session.is_full(); ++answers)
    session.text("{");
  EXPECT_GT(answers, 10'000u);
  EXPECT_LT(answers, FoxgloveSession::kLimit / 20);
}

}  // namespace
}  // namespace drivebench::web::foxglove_session_test
