// The numbers of converters and the timers of the encoder, as firmware reads them.
#include <gtest/gtest.h>

#include <cmath>

#include "plant/axis.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::converters_test {
namespace {

AxisParameters counted_axis() {
  AxisParameters p = servo_axis();
  p.sensors.counts = true;
  p.sensors.current.bits = 12;
  p.sensors.current.full_scale_a = 8.0;
  p.sensors.current.offset_b_a = 0.5;
  p.sensors.bus = {.enabled = true, .bits = 10, .full_scale = 4096.0};
  p.sensors.temperature = {.enabled = true, .bits = 8, .full_scale = 512.0};
  return p;
}

// A converter of n bits says 2^(n-1) at zero, the reading over its step more elsewhere, and stays within its
// ends. Catches: a signed number, a zero at the lower end, a count that leaves offset or limit out, one of
// another channel.
TEST(Converters, ANumberIsTheReadingInStepsFromTheMiddle) {
  Axis axis(counted_axis(), kServoTiming, 1, 0);
  Sample s = axis.sample(0);
  EXPECT_EQ(s.i_a_counts, 2048u);
  EXPECT_EQ(s.i_b_counts, 2048u + 128u) << "0.5 A of steps of 8 A/2048";
  EXPECT_EQ(s.i_c_counts, 0u) << "two phases";
  EXPECT_EQ(s.u_a_counts, 0u) << "ideal";
  EXPECT_EQ(s.bus_counts, 512u + 125u) << "1000 V of steps of 8 V";
  EXPECT_EQ(s.temperature_counts, 128u + 73u) << "293.15 K of steps of 4 K";
  bool beyond = false;
  for (Tick tick = 0; tick < 100; ++tick) {
    axis.advance({.gates = Gates::kVoltage, .setpoint = {.a = 30.0, .b = -5.0}}, tick);
    s = axis.sample(tick + 1);
    EXPECT_EQ(static_cast<double>(s.i_a_counts), 2048.0 + s.i_a_a / (8.0 / 2048.0));
    EXPECT_EQ(static_cast<double>(s.i_b_counts), 2048.0 + s.i_b_a / (8.0 / 2048.0));
    beyond = beyond || s.i_a_counts == 4095u;
  }
  EXPECT_TRUE(beyond) << "17 A";
  axis.inject(find_injectable_fault("current_sensor_stuck"), 1.0);
  EXPECT_EQ(axis.sample(100).i_a_counts, 2048u) << "a sensor that reads zero";
}

// Catches: numbers of benches that did not ask for them, whose hashes would change.
TEST(Converters, NumbersAndTimersAreZeroUnlessConfigured) {
  AxisParameters p = counted_axis();
  p.sensors.counts = false;
  Axis axis(p, kServoTiming, 1, 0);
  for (Tick tick = 0; tick < 50; ++tick)
    axis.advance({.gates = Gates::kVoltage, .setpoint = {.a = 30.0, .b = -5.0}}, tick);
  const Sample s = axis.sample(50);
  EXPECT_EQ(s.i_a_counts | s.i_b_counts | s.bus_counts | s.temperature_counts, 0u);
  EXPECT_EQ(s.encoder_timer | s.encoder_capture, 0u);
  EXPECT_NE(s.i_a_a, 0.0);
}

// Catches: a timer that saturates, or counts from the other end when the count is negative; a capture in
// seconds or ticks, one that wraps.
TEST(Converters, TheTimerWrapsAndTheCaptureHoldsItsLargestNumber) {
  EncoderParameters p{.counts_per_revolution = 2000, .timer_bits = 16, .capture_hz = 1e6};
  const Encoder encoder(p, 1e-4);
  EXPECT_EQ(encoder.timer({.count = 70'000}), 4464u);
  EXPECT_EQ(encoder.timer({.count = -1}), 65'535u);
  EXPECT_EQ(encoder.capture({.period_s = 0.0}), 0u);
  EXPECT_EQ(encoder.capture({.period_s = 123.9e-6}), 123u);
  EXPECT_EQ(encoder.capture({.period_s = 0.0655349}), 65'534u);
  EXPECT_EQ(encoder.capture({.period_s = 3.0}), 65'535u);
  EXPECT_EQ(encoder.capture({.period_s = -1.0}), 0u) << "a state that no tick has made";
  p.timer_bits = 32;
  EXPECT_EQ(Encoder(p, 1e-4).timer({.count = -1}), 4'294'967'295u);
}

// 10 kohm at 25 degrees and B = 3435 K under 10 kohm: half of the range at 25 degrees, at 100 degrees
// R = 10 kohm exp(3435 (1/373.15 - 1/298.15)) = 987 ohm, and the number falls with the heat. Catches: a
// thermistor on the other side of the divider, B with the other sign, a number of the linear converter, one
// beyond its bits.
TEST(Converters, AThermistorGivesTheNumberOfItsDivider) {
  const NtcParameters ntc{.ohm = 10e3, .beta_k = 3435.0, .pull_ohm = 10e3};
  EXPECT_EQ(ntc_count(ntc, 298.15, 12), 2048u);
  const double hot_ohm = 10e3 * std::exp(3435.0 * (1.0 / 373.15 - 1.0 / 298.15));
  EXPECT_EQ(ntc_count(ntc, 373.15, 12), static_cast<std::uint64_t>(4096.0 * hot_ohm / (hot_ohm + 10e3)));
  EXPECT_EQ(ntc_count(ntc, -5.0, 12), 4095u);
  EXPECT_LT(ntc_count(ntc, 1e6, 12), 10u);
  AxisParameters p = counted_axis();
  p.sensors.ntc = ntc;
  p.sensors.temperature = {.enabled = true, .bits = 12, .full_scale = 500.0};
  p.thermal.ambient_k = 298.15;
  EXPECT_TRUE(problems(p).empty());
  const Axis axis(p, kServoTiming, 1, 0);
  EXPECT_EQ(axis.sample(0).temperature_counts, 2048u);
  EXPECT_NEAR(axis.sample(0).temperature_k, 298.15, 0.2);
  p.sensors.ntc.pull_ohm = 0.0;
  p.sensors.counts = false;
  const std::vector<Problem> found = problems(p);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].field, "temperature_sensor.ntc_ohm");
  EXPECT_EQ(found[1].field, "temperature_sensor.ntc_ohm");
}

// Catches: a switch that does nothing because no converter has bits, a capture without a timer.
TEST(Converters, TheRulesNameWhatIsMissing) {
  const auto has_rule = [](const AxisParameters& p, std::string_view field) {
    for (const Problem& each : problems(p))
      if (each.field == field) return true;
    return false;
  };
  AxisParameters p = servo_axis();
  p.sensors.counts = true;
  EXPECT_TRUE(has_rule(p, "converter.counts"));
  p.sensors.bus = {.enabled = false, .bits = 10};
  EXPECT_TRUE(has_rule(p, "converter.counts"));
  p.sensors.bus.enabled = true;
  EXPECT_FALSE(has_rule(p, "converter.counts"));
  p.encoder.capture_hz = 1e6;
  EXPECT_TRUE(has_rule(p, "encoder.capture_hz"));
  p.encoder.timer_bits = 16;
  EXPECT_FALSE(has_rule(p, "encoder.capture_hz"));
}

}  // namespace
}  // namespace drivebench::converters_test
