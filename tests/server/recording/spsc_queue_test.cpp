#include "server/recording/spsc_queue.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <set>
#include <thread>

namespace drivebench::spsc_queue_test {
namespace {

// Catches: a capacity that is more, or less, than the requested one.
TEST(SpscQueue, CapacityIsTheRequestedOne) {
  for (const std::size_t capacity : {1u, 5u, 64u, 65u, 200u}) {
    SpscQueue<int> queue(capacity);
    EXPECT_EQ(queue.capacity(), capacity);
    for (std::size_t n = 0; n < capacity; ++n)
      EXPECT_TRUE(queue.push(1));
    EXPECT_FALSE(queue.push(1));
  }
}

// Catches: a slot that is lost or used twice at the full and the empty end.
TEST(SpscQueue, FillsToItsCapacityAndEmptiesToNothing) {
  SpscQueue<int> queue(4);
  for (int lap = 0; lap < 5; ++lap) {
    EXPECT_EQ(queue.front(), nullptr);
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(queue.room(), static_cast<std::size_t>(4 - i));
      EXPECT_TRUE(queue.push(10 * lap + i));
    }
    EXPECT_EQ(queue.room(), 0u);
    EXPECT_FALSE(queue.push(99));
    for (int i = 0; i < 4; ++i) {
      ASSERT_NE(queue.front(), nullptr);
      EXPECT_EQ(*queue.front(), 10 * lap + i);
      EXPECT_EQ(queue.front(), queue.front()) << "looking changes nothing";
      queue.pop();
    }
  }
}

// Catches: an order that goes wrong where a block, or the list of the blocks in use, ends; a block that is
// given back too early; at every fill level of a queue of a few blocks.
TEST(SpscQueue, KeepsOrderFromBlockToBlock) {
  constexpr int kCapacity = 3 * SpscQueue<int>::kBlockEntries + 7;
  SpscQueue<int> queue(kCapacity);
  int next_in = 0;
  int next_out = 0;
  for (int level = 1; level <= kCapacity; ++level) {
    for (int round = 0; round < 40; ++round) {
      while (next_in - next_out < level)
        ASSERT_TRUE(queue.push(next_in++));
      ASSERT_EQ(*queue.front(), next_out++);
      queue.pop();
    }
  }
}

// Catches: a queue that goes through all of its memory though it is nearly empty, which each tick pays for.
TEST(SpscQueue, UsesTheBlockThatWasEmptiedLast) {
  constexpr std::size_t kBlock = SpscQueue<int>::kBlockEntries;
  SpscQueue<int> queue(100 * kBlock);
  const auto places_of = [&queue](std::size_t backlog, std::size_t entries) {
    std::set<const int*> places;
    for (std::size_t n = 0; n < entries + backlog; ++n) {
      if (n < entries) {
        EXPECT_TRUE(queue.push(0));
      }
      if (n < backlog) continue;
      places.insert(queue.front());
      queue.pop();
    }
    return places.size();
  };
  EXPECT_LE(places_of(3, 1000 * kBlock), 2 * kBlock);
  places_of(90 * kBlock, 200 * kBlock);  // once it was long
  EXPECT_LE(places_of(3, 1000 * kBlock), 3 * kBlock);
}

void expect_order_between_threads(std::size_t capacity) {
  struct Entry {
    std::uint64_t number;
    std::uint64_t copies[7];
  };
  constexpr std::uint64_t kCount = 300'000;
  SpscQueue<Entry> queue(capacity);
  std::thread producer([&queue] {
    for (std::uint64_t n = 0; n < kCount;) {
      const Entry entry{n, {n, n, n, n, n, n, n}};
      if (queue.push(entry)) {
        ++n;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t wrong = 0;
  for (std::uint64_t n = 0; n < kCount;) {
    const Entry* entry = queue.front();
    if (entry == nullptr) {
      std::this_thread::yield();
      continue;
    }
    if (entry->number != n) ++wrong;
    for (const std::uint64_t copy : entry->copies) {
      if (copy != n) ++wrong;
    }
    queue.pop();
    ++n;
  }
  producer.join();
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(queue.front(), nullptr);
}

// Catches: an entry that is seen before it is written, lost, doubled or out of order between two threads; a
// missing release or acquire (under the thread sanitizer).
TEST(SpscQueue, TwoThreadsSeeEveryEntryOnceAndInOrder) {
  expect_order_between_threads(16);
  expect_order_between_threads(1000);
}

}  // namespace
}  // namespace drivebench::spsc_queue_test
