#include "clients/command/bench/watch_text.hpp"

#include <gtest/gtest.h>

namespace drivebench::command::watch_test {
namespace {

std::string shown(std::string_view name, const Sample& sample) {
  return shown_value(*find_signal(name), sample);
}

// Catches: the rounding noise of a model at rest shown as 8.5e-170, and a small value that means something
// shown as 0.
TEST(Watch, ShowsAMagnitudeFarBelowTheUsualRangeAsZero) {
  EXPECT_EQ(shown("speed_rad_s", {.speed_rad_s = 8.5e-170}), "0");
  EXPECT_EQ(shown("i_a_a", {.i_a_a = -2.2e-16}), "0");
  EXPECT_EQ(shown("i_a_a", {.i_a_a = -0.0012345678}), "-0.0012346");
  EXPECT_EQ(shown("angle_rad", {.angle_rad = 0.0031415926}), "0.0031416");
  EXPECT_EQ(shown("u_a_v", {.u_a_v = 79.9999999}), "80");
  EXPECT_EQ(shown("encoder_count", {.encoder_count = -12345678}), "-12345678");
}

}  // namespace
}  // namespace drivebench::command::watch_test
