#include "clients/control/math/limits.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <stdexcept>

namespace drivebench::control::limits_test {
namespace {

/// A current that rises by 10 A/s and a voltage that falls by 100 V/s.
std::array<Demand, 2> ramps(double t_s) {
  return {{{"stator current", 10.0 * t_s, 6.0, "A"}, {"stator voltage", -100.0 * t_s, 80.0, "V"}}};
}

// Catches: a check of the end only, one without the magnitude, and one that reports the last instead of the
// first: -100 V/s meets 80 V at 0.8 s, but 10 A/s meets 6 A at 0.6 s.
TEST(Limits, TheFirstExceededLimitIsNamedWithItsTime) {
  const auto found = first_exceeded(1.0, 1e-3, ramps);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->demand.quantity, "stator current");
  EXPECT_NEAR(found->time_s, 0.601, 1e-9);
  EXPECT_EQ(found->sentence(), "stator current of 6.01 A at 0.601 s is above the limit of 6 A");
}

// Catches: < for <=, and an end of the move that is stepped over: 0.6 s lies on no multiple of 0.35 s.
TEST(Limits, ADemandAtItsLimitIsAllowedAndTheEndIsChecked) {
  EXPECT_FALSE(first_exceeded(0.6, 0.1, ramps));
  const auto at_end = first_exceeded(0.61, 0.35, ramps);
  ASSERT_TRUE(at_end);
  EXPECT_NEAR(at_end->time_s, 0.61, 1e-12);
}

// Catches: a comparison that a division by zero slips through.
TEST(Limits, ADemandThatIsNotANumberIsExceeded) {
  const auto found = first_exceeded(1.0, 0.5, [](double) {
    return std::array<Demand, 1>{{{"flux", std::numeric_limits<double>::quiet_NaN(), 1.0, "Wb"}}};
  });
  ASSERT_TRUE(found);
  EXPECT_EQ(found->time_s, 0.0);
}

// Catches: a check that takes years over a move that a typing error made long.
TEST(Limits, AVeryLongMoveIsCheckedAMillionTimes) {
  int looks = 0;
  EXPECT_FALSE(first_exceeded(1e12, 1e-4, [&looks](double) {
    ++looks;
    return std::array<Demand, 0>{};
  }));
  EXPECT_EQ(looks, 1'000'001);
}

// Catches: a refusal that does not say what and when.
TEST(Limits, ARefusalCarriesTheSentence) {
  EXPECT_NO_THROW(refuse(std::nullopt));
  try {
    refuse(first_exceeded(1.0, 1e-3, ramps));
    FAIL() << "not refused";
  } catch (const std::invalid_argument& e) {
    EXPECT_STREQ(e.what(),
                 "the move cannot be made: stator current of 6.01 A at 0.601 s is above the limit of 6 A");
  }
}

}  // namespace
}  // namespace drivebench::control::limits_test
