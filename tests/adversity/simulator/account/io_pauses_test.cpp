#include "tests/adversity/simulator/account/io_pauses.hpp"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace drivebench::simulator::io_pauses_test {
namespace {

constexpr Time kLimit = 2000 * kMillisecond;

/// The end [ms] of a limit of 2 s that begins at 1 s, when the I/O runs each 5 ms but for these pauses, which
/// end in order.
Time end_with(const std::vector<std::pair<Time, Time>>& pauses_ms) {
  IoPauses io;
  Time now = 0;
  const auto run_until = [&](Time end) {
    for (; now <= end; now += 5)
      io.ran(now * kMillisecond);
  };
  for (const auto& [begin, end] : pauses_ms) {
    run_until(begin);
    now = end;
  }
  run_until(10'000);
  return io.end_of(kSecond, kLimit) / kMillisecond;
}

// Catches: a pause that moves the end although it lies elsewhere; an end within a pause that is not moved, or
// by the whole pause; a second pause that does not count; a limit that runs before the server knows the
// client.
TEST(IoPauses, ALimitThatEndsInAPauseIsLongerByTheRestOfThePause) {
  EXPECT_EQ(end_with({}), 3000);
  EXPECT_EQ(end_with({{500, 700}, {2800, 2990}, {3020, 3200}}), 3000);
  EXPECT_EQ(end_with({{2900, 3100}}), 3200);
  EXPECT_EQ(end_with({{2900, 3100}, {3150, 3250}}), 3300);
  EXPECT_EQ(end_with({{900, 1100}}), 3100) << "the server takes the client at 1.1 s";
  EXPECT_EQ(end_with({{1000, 1100}}), 3100) << "the pause begins as the client comes";
  EXPECT_EQ(end_with({{900, 1100}, {3000, 3150}}), 3200);
}

}  // namespace
}  // namespace drivebench::simulator::io_pauses_test
