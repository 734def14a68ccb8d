#include "server/recording/spsc_ring.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>

namespace drivebench {
namespace {

// Catches: a capacity that is more, or less, than the requested one.
TEST(SpscRing, CapacityIsTheRequestedOne) {
  for (const std::size_t capacity : {1u, 5u, 8u}) {
    SpscRing<int> ring(capacity);
    EXPECT_EQ(ring.capacity(), capacity);
    for (std::size_t n = 0; n < capacity; ++n)
      EXPECT_TRUE(ring.push(1));
    EXPECT_FALSE(ring.push(1));
  }
}

// Catches: a slot that is lost or used twice at the full and the empty end.
TEST(SpscRing, FillsToItsCapacityAndEmptiesToNothing) {
  SpscRing<int> ring(4);
  for (int lap = 0; lap < 5; ++lap) {
    EXPECT_EQ(ring.front(), nullptr);
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(ring.room(), static_cast<std::size_t>(4 - i));
      EXPECT_TRUE(ring.push(10 * lap + i));
    }
    EXPECT_EQ(ring.room(), 0u);
    EXPECT_FALSE(ring.push(99));
    for (int i = 0; i < 4; ++i) {
      ASSERT_NE(ring.front(), nullptr);
      EXPECT_EQ(*ring.front(), 10 * lap + i);
      EXPECT_EQ(ring.front(), ring.front()) << "looking changes nothing";
      ring.pop();
    }
  }
}

// Catches: an index that goes wrong where it passes the end of the slots, at every fill level.
TEST(SpscRing, KeepsOrderAroundTheWrap) {
  SpscRing<int> ring(7);
  int next_in = 0;
  int next_out = 0;
  for (int level = 1; level <= 7; ++level) {
    for (int round = 0; round < 40; ++round) {
      while (next_in - next_out < level)
        ASSERT_TRUE(ring.push(next_in++));
      ASSERT_EQ(*ring.front(), next_out++);
      ring.pop();
    }
  }
}

// Catches: an entry that is seen before it is written, lost, doubled or out of order between two threads; a
// missing release or acquire (under the thread sanitizer).
TEST(SpscRing, TwoThreadsSeeEveryEntryOnceAndInOrder) {
  struct Entry {
    std::uint64_t number;
    std::uint64_t copies[7];
  };
  constexpr std::uint64_t kCount = 300'000;
  SpscRing<Entry> ring(16);
  std::thread producer([&ring] {
    for (std::uint64_t n = 0; n < kCount;) {
      const Entry entry{n, {n, n, n, n, n, n, n}};
      if (ring.push(entry)) {
        ++n;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t wrong = 0;
  for (std::uint64_t n = 0; n < kCount;) {
    const Entry* entry = ring.front();
    if (entry == nullptr) {
      std::this_thread::yield();
      continue;
    }
    if (entry->number != n) ++wrong;
    for (const std::uint64_t copy : entry->copies) {
      if (copy != n) ++wrong;
    }
    ring.pop();
    ++n;
  }
  producer.join();
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(ring.front(), nullptr);
}

}  // namespace
}  // namespace drivebench
