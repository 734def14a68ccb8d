#include "plant/sensors/analog_channel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "plant/sensors/current_sensor.hpp"
#include "tests/plant/analog_reading.hpp"

namespace drivebench::analog_channel_test {
namespace {

// Catches: an offset under the gain, noise that the gain scales, a converter where none is.
TEST(AnalogChannel, WithoutAConverterItIsTheStraightLine) {
  const AnalogParameters p{.full_scale = 1.0, .gain = 1.1, .offset = -0.25, .noise_rms = 0.5};
  const AnalogReading r = read_analog(p, 70.0, 0.2);
  EXPECT_EQ(r.value, 1.1 * 70.0 - 0.25 + 0.5 * 0.2);
  EXPECT_FALSE(r.saturated);
}

// Catches: a step of the wrong size, truncation in place of the nearest step, noise or offset behind the
// converter.
TEST(AnalogChannel, TheConverterRoundsWhatGainOffsetAndNoiseHaveMade) {
  const AnalogParameters p{.bits = 10, .full_scale = 64.0, .gain = 2.0, .offset = 0.03, .noise_rms = 0.5};
  constexpr double kStep = 0.125;
  for (const double x : {-20.0, -3.3, -0.04, 0.0, 0.06, 17.77}) {
    for (const double noise : {-1.3, 0.0, 0.4}) {
      const AnalogReading r = read_analog(p, x, noise);
      EXPECT_EQ(r.value, kStep * std::floor((2.0 * x + 0.03 + 0.5 * noise) / kStep + 0.5));
      EXPECT_FALSE(r.saturated);
    }
  }
}

// Catches: an end that is a step too far, a flag on one side only.
TEST(AnalogChannel, TheConverterHoldsAtItsEnds) {
  const AnalogParameters p{.bits = 2, .full_scale = 4.0};
  EXPECT_EQ(read_analog(p, 2.9, 0.0).value, 2.0);  // steps of 2 V: -4, -2, 0, 2
  EXPECT_FALSE(read_analog(p, 2.9, 0.0).saturated);
  EXPECT_EQ(read_analog(p, 3.0, 0.0).value, 2.0);
  EXPECT_TRUE(read_analog(p, 3.0, 0.0).saturated);
  EXPECT_EQ(read_analog(p, -5.0, 0.0).value, -4.0);
  EXPECT_FALSE(read_analog(p, -5.0, 0.0).saturated);
  EXPECT_EQ(read_analog(p, -5.1, 0.0).value, -4.0);
  EXPECT_TRUE(read_analog(p, -5.1, 0.0).saturated);
}

// Catches: a current sensor that rounds or scales in another way than the other channels.
TEST(AnalogChannel, ACurrentSensorReadsAsAnAnalogChannelDoes) {
  const CurrentSensorParameters sensor{.bits = 12, .full_scale_a = 20.0, .noise_rms_a = 0.1};
  const AnalogParameters channel{
      .bits = 12, .full_scale = 20.0, .gain = 1.02, .offset = 0.3, .noise_rms = 0.1};
  for (int k = -300; k <= 300; ++k) {
    const double current_a = 0.077 * k;
    const AnalogReading a = read_current(sensor, 1.02, 0.3, current_a, 0.7);
    const AnalogReading b = read_analog(channel, current_a, 0.7);
    ASSERT_EQ(a.value, b.value);
    ASSERT_EQ(a.saturated, b.saturated);
  }
}

// Catches: delays that no ring holds, quarter ticks that would be cut to whole ones.
TEST(AnalogChannel, ADelayIsNoneHalfATickOrWholeTicksUpToEight) {
  for (const double ticks : {0.0, 0.5, 1.0, 2.0, 7.0, 8.0})
    EXPECT_TRUE(is_sensor_delay(ticks)) << ticks;
  for (const double ticks : {-1.0, -0.5, 0.25, 1.5, 7.5, 8.5, 9.0, std::nan("")})
    EXPECT_FALSE(is_sensor_delay(ticks)) << ticks;
}

}  // namespace
}  // namespace drivebench::analog_channel_test
