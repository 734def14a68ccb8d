#include "clients/web/gateway/relays/send_queue.hpp"

#include <bench.pb.h>
#include <gtest/gtest.h>

#include <string>

#include "protocols/framing.hpp"

namespace drivebench::web::send_queue_test {
namespace {

std::string samples_of(std::uint32_t axis, std::uint64_t first, int count, std::uint64_t dropped = 0) {
  v1::Envelope envelope;
  envelope.mutable_samples()->set_axis(axis);
  envelope.mutable_samples()->set_dropped(dropped);
  for (int i = 0; i < count; ++i)
    envelope.mutable_samples()->add_samples()->set_tick(first + static_cast<std::uint64_t>(i));
  return envelope.SerializeAsString();
}

bool add(SendQueue& queue, const std::string& payload) {
  return queue.add(std::as_bytes(std::span(payload)));
}

/// The envelopes of the message that waits.
std::vector<v1::Envelope> taken(SendQueue& queue) {
  std::vector<std::byte> message;
  queue.take(message);
  std::vector<v1::Envelope> envelopes;
  for (std::span<const std::byte> rest(message); !rest.empty();) {
    std::size_t size = 0;
    for (const std::byte each : rest.first(kFrameHeaderSize))
      size = size << 8 | std::to_integer<std::size_t>(each);
    envelopes.emplace_back().ParseFromArray(rest.subspan(kFrameHeaderSize).data(), static_cast<int>(size));
    rest = rest.subspan(kFrameHeaderSize + size);
  }
  return envelopes;
}

// Catches: samples that a slow browser loses without being told, or that are counted twice or for the other
// axis.
TEST(SendQueue, WEB_05_ASlowBrowserIsToldHowManySamplesItLost) {
  SendQueue queue;
  std::uint64_t sent = 0;
  for (std::uint64_t i = 0; i < 20'000; ++i, sent += 10)
    ASSERT_TRUE(add(queue, samples_of(0, 10 * i, 10)));
  ASSERT_TRUE(add(queue, samples_of(1, 7, 3, 100)));
  std::uint64_t got = 0;
  for (const v1::Envelope& each : taken(queue)) {
    EXPECT_EQ(each.samples().dropped(), 0u);
    got += static_cast<std::uint64_t>(each.samples().samples_size());
  }
  EXPECT_LT(got, sent);
  EXPECT_GT(got, 0u);

  ASSERT_TRUE(add(queue, samples_of(0, sent, 1, 5)));
  ASSERT_TRUE(add(queue, samples_of(0, sent + 1, 1)));
  ASSERT_TRUE(add(queue, samples_of(1, 10, 1)));
  const auto after = taken(queue);
  ASSERT_EQ(after.size(), 3u);
  EXPECT_EQ(after[0].samples().dropped(), sent - got + 5);
  EXPECT_EQ(after[1].samples().dropped(), 0u);
  EXPECT_EQ(after[2].samples().dropped(), 103u);
}

// Catches: an answer that is dropped like a sample, and a queue without an end.
TEST(SendQueue, WEB_05_AnswersAlwaysGoThroughUpToALimit) {
  SendQueue queue;
  v1::Envelope answer;
  answer.set_id(1);
  answer.mutable_refusal()->set_message(std::string(1000, 'x'));
  const std::string payload = answer.SerializeAsString();
  std::size_t answers = 0;
  while (add(queue, payload))
    ++answers;
  EXPECT_GT(answers, 4000u);
  EXPECT_LE(answers, SendQueue::kLimit / payload.size());
  EXPECT_EQ(taken(queue).size(), answers);
  EXPECT_TRUE(add(queue, payload));
}

}  // namespace
}  // namespace drivebench::web::send_queue_test
