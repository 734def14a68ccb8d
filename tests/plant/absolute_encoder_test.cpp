// The absolute encoder: the angle of an instant before the sample, as a number.
#include "plant/sensors/absolute_encoder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "plant/parameters/later_rows.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::absolute_encoder_test {
namespace {

constexpr double kTick_s = 100e-6;
constexpr double kOffset_rad = 0.3;

constexpr double kKnee_s = 36e-6;

/// A rotor that gains speed up to the knee of each tick and loses it again in the rest.
struct Rotor {
  double speed_rad_s;  ///< where a tick starts
  double gain;         ///< [rad/s^2]

  double loss() const { return gain * kKnee_s / (kTick_s - kKnee_s); }
  double speed_within(double s) const {
    return speed_rad_s + gain * std::min(s, kKnee_s) - loss() * std::max(0.0, s - kKnee_s);
  }
  double angle_within(double s) const {
    const double later_s = std::max(0.0, s - kKnee_s);
    const double early_s = std::min(s, kKnee_s);
    return (speed_rad_s + 0.5 * gain * early_s) * early_s +
           (speed_rad_s + gain * kKnee_s - 0.5 * loss() * later_s) * later_s;
  }
  double angle_rad(Tick tick, double s) const {
    return static_cast<double>(tick) * angle_within(kTick_s) + angle_within(s);
  }
  /// Within the turn in which the tick starts.
  AngleSegment part(Tick tick, double from_s, double to_s) const {
    const double turn_rad = std::floor(angle_rad(tick, 0.0) / kTurnRad) * kTurnRad;
    return {.start_s = from_s,
            .duration_s = to_s - from_s,
            .start_rad = angle_rad(tick, from_s) - turn_rad,
            .end_rad = angle_rad(tick, to_s) - turn_rad,
            .start_rad_s = speed_within(from_s),
            .end_rad_s = speed_within(to_s)};
  }
};

std::uint64_t number_of(double angle_rad, int bits) {
  const double turns = (angle_rad + kOffset_rad) / kTurnRad;
  return static_cast<std::uint64_t>((turns - std::floor(turns)) * std::exp2(bits));
}

// Latencies of nothing, parts of a tick, whole ticks and both, forwards and backwards through many turns.
// With 20 bits a number is 6 urad: at 6000 rad/s the rotor passes one in a nanosecond. Catches: the angle of
// another tick or of a node, an angle that goes linearly, a latency that is added, an offset of the other
// sign, a number that is negative or does not wrap, one of two parts of a tick that overwrites the other.
TEST(AbsoluteEncoder, TheNumberIsTheAngleOfItsInstant) {
  constexpr int kBits = 20;
  for (const double latency_s :
       {0.0, 3.7e-6, 63e-6, 64e-6, 99.9e-6, 100e-6, 150e-6, 700e-6, 736.1e-6, 800e-6}) {
    const AbsoluteEncoder encoder({.bits = kBits, .latency_s = latency_s, .offset_rad = kOffset_rad},
                                  kTick_s);
    for (const double speed_rad_s : {-6000.0, 6000.0}) {
      const Rotor rotor{.speed_rad_s = speed_rad_s, .gain = 4e7};
      AbsoluteMemory whole = encoder.settled(0.0);
      AbsoluteMemory parted = whole;
      for (Tick tick = 0; tick < 100; ++tick) {
        const std::vector<AngleSegment> two{rotor.part(tick, 0.0, kKnee_s),
                                            rotor.part(tick, kKnee_s, kTick_s)};
        encoder.follow(whole, two);
        for (const AngleSegment& each : two)
          encoder.follow(parted, std::span(&each, 1));
        encoder.end_tick(whole, tick + 1);
        encoder.end_tick(parted, tick + 1);
        ASSERT_EQ(encoder.read(parted, tick + 1), encoder.read(whole, tick + 1));
        const auto late = static_cast<Tick>(std::floor(latency_s / kTick_s + 1e-9));
        const double within_s = kTick_s - (latency_s - static_cast<double>(late) * kTick_s);
        const double angle_rad = tick >= late ? rotor.angle_rad(tick - late, within_s) : 0.0;
        // Rounding of the angle may take it across a boundary.
        const std::uint64_t number = encoder.read(whole, tick + 1);
        if (number != number_of(angle_rad - 1e-11, kBits)) {
          ASSERT_EQ(number, number_of(angle_rad + 1e-11, kBits)) << latency_s << " " << tick;
        }
      }
    }
  }
}

// A rotor that coasts. Catches: an axis that shows a number without an encoder, that shows it a tick late, or
// that loses what is on its way when its state is restored.
TEST(AbsoluteEncoder, AnAxisThatCoastsShowsTheAngleOfBefore) {
  for (const double latency_s : {0.0, 20e-6, kServoTick_s, 2.5 * kServoTick_s}) {
    AxisParameters p = servo_axis();
    p.mechanics = {.inertia_kgm2 = 1.0};
    p.sensors.absolute = {.bits = 14, .latency_s = latency_s};
    ASSERT_TRUE(problems(p).empty());
    Axis axis(p, kServoTiming, 1, 0);
    spin(axis, 400.0);
    for (Tick tick = 0; tick < 300; ++tick) {
      axis.advance({}, tick);
      if (tick % 7 == 0) {
        Axis other(p, kServoTiming, 1, 0);
        other.restore(axis.state());
        axis = other;
      }
      const double angle_rad = std::max(0.0, axis.sample(tick + 1).angle_rad - 400.0 * latency_s);
      const double turns = angle_rad / kTurnRad;
      ASSERT_NEAR(static_cast<double>(axis.sample(tick + 1).absolute_angle) + 0.5,
                  (turns - std::floor(turns)) * 16384.0, 0.5 + 1e-6)
          << latency_s << " " << tick;
    }
    p.sensors.absolute = {};
    Axis none(p, kServoTiming, 1, 0);
    spin(none, 400.0);
    none.advance({}, 0);
    EXPECT_EQ(none.sample(1).absolute_angle, 0u);
  }
}

// Catches: a latency of more ticks than are kept, values that have no effect.
TEST(AbsoluteEncoder, TheRulesNameTheFieldAndTheReason) {
  AxisParameters p = servo_axis();
  p.sensors.absolute = {.latency_s = 1e-6, .offset_rad = 0.5};
  const std::vector<Problem> found = problems(p);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].field + " " + found[0].rule,
            "absolute_encoder.latency_s is 1e-06 s but needs absolute_encoder.bits above 0, which is 0");
  EXPECT_EQ(found[1].field + " " + found[1].rule,
            "absolute_encoder.offset_rad is 0.5 rad but needs absolute_encoder.bits above 0, which is 0");
  p.sensors.absolute = {.bits = 12, .latency_s = 801e-6};
  EXPECT_TRUE(problems(p).empty());
  std::vector<Problem> late;
  Problems rules(late);
  add_period_problems(p, kTick_s, rules);
  ASSERT_EQ(late.size(), 1u);
  EXPECT_EQ(late[0].field + " " + late[0].rule,
            "absolute_encoder.latency_s is 0.000801 s but may be at most 8 ticks, 8e-04 s");
}

}  // namespace
}  // namespace drivebench::absolute_encoder_test
