// The field-oriented servo of 8.2.2 on the product's own bench, in process: cases 4 to 7 of the reference
// table. The last digits are chaotic (see tests/control/run_test.cpp), hence the room in the tolerances.
#include <gtest/gtest.h>

#include "tests/book/closed_loop.hpp"

namespace drivebench {
namespace {

// Case 4. Catches a wrong sign, gain or frame anywhere between the preset and the plant. The table has 1.49
// counts, 73.6 rad/s, 5.46 A.
TEST(ServoControl, BookMoveStaysWithinTwoCounts) {
  const Outcome seen = closed_loop("book/8.2.2");
  EXPECT_LE(seen.peak_error_counts, 2.0);
  EXPECT_NEAR(seen.peak_error_counts, 1.49, 0.2);
  EXPECT_LE(seen.final_encoder_error_counts, 1.0 + 1e-9);
  EXPECT_NEAR(seen.peak_speed_rad_s, 73.6, 0.5);
  EXPECT_NEAR(seen.peak_current_a, 5.46, 0.3);
  EXPECT_EQ(seen.samples, 200 + 584 + 240);
  EXPECT_EQ(seen.saturated_samples, 0);
}

}  // namespace
}  // namespace drivebench
