#include "server/engine/mailbox.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>

namespace drivebench::mailbox_test {
namespace {

// Catches: a value before there is one, the same one twice, an old one in place of the newest.
TEST(Mailbox, GivesTheNewestOnceAndNothingElse) {
  Mailbox<int> box;
  EXPECT_EQ(box.take(), std::nullopt);
  for (int round = 0; round < 10; ++round) {
    for (int n = 0; n < round; ++n)
      box.write(100 * round + n);
    EXPECT_EQ(box.take(), round == 0 ? std::nullopt : std::optional(100 * round + round - 1));
    EXPECT_EQ(box.take(), std::nullopt);
  }
}

// Catches: a value that is torn between two writes, comes twice or goes backwards, and a last one that never
// arrives; a slot that both threads use (under the thread sanitizer).
TEST(Mailbox, TwoThreadsNeverSeeATornOrOldValue) {
  struct Value {
    std::uint64_t words[16];
  };
  constexpr std::uint64_t kCount = 200'000;
  Mailbox<Value> box;
  std::thread writer([&box] {
    for (std::uint64_t n = 1; n <= kCount; ++n) {
      Value value;
      std::fill(std::begin(value.words), std::end(value.words), n);
      box.write(value);
      if (n % 64 == 0) std::this_thread::yield();
    }
  });
  std::uint64_t newest = 0;
  std::uint64_t torn = 0;
  std::uint64_t backwards = 0;
  while (newest < kCount) {
    const auto value = box.take();
    if (!value) {
      std::this_thread::yield();
      continue;
    }
    for (const std::uint64_t word : value->words) {
      if (word != value->words[0]) ++torn;
    }
    if (value->words[0] <= newest) ++backwards;
    newest = value->words[0];
  }
  writer.join();
  EXPECT_EQ(torn, 0u);
  EXPECT_EQ(backwards, 0u);
  EXPECT_EQ(box.take().has_value(), false);
}

}  // namespace
}  // namespace drivebench::mailbox_test
