#include "plant/sensors/sensor_bank.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/plant/sensor_point.hpp"

namespace drivebench::sensor_filter_test {
namespace {

using namespace sensor_point;

// A ramp, so that the middle is known; nodes even, odd, and cut by events on both sides of the middle, at it,
// and an ulp beside it. Catches: the start or end of the interval in place of its middle, an interval that is
// not found, a value of the tick before.
TEST(SensorFilter, HalfATickShowsTheMiddleOfTheLastTick) {
  SensorParameters p;
  p.current.delay_ticks = 0.5;
  const double half_s = 0.5 * kTick_s;
  const std::vector<std::vector<double>> grids{
      even_nodes(1),
      even_nodes(5),
      even_nodes(10),
      {0.0, 0.31 * kTick_s, 0.93 * kTick_s, kTick_s},
      {0.0, half_s, half_s, kTick_s},
      {0.0, std::nextafter(half_s, 0.0), std::nextafter(half_s, 1.0), kTick_s}};
  for (const std::vector<double>& nodes_s : grids) {
    const SensorBank bank = bank_of(p);
    EXPECT_TRUE(bank.follows());
    SensorMemory m;
    for (Tick tick = 0; tick < 5; ++tick) {
      run_tick(bank, m, tick, nodes_s, [](double t) { return current_point(7.0 + 3e4 * t); });
      const double middle_s = (static_cast<double>(tick) + 0.5) * kTick_s;
      EXPECT_NEAR(bank.readings(m, {}, tick + 1).i_a_a, 7.0 + 3e4 * middle_s, 1e-12);
    }
  }
}

// Catches: a middle taken from the tick's ends, across a voltage that jumps.
TEST(SensorFilter, HalfATickAfterAJumpShowsTheVoltageOfThatInstant) {
  SensorParameters p = all_on();
  p.voltage.delay_ticks = 0.5;
  const SensorBank bank = bank_of(p);
  SensorMemory m;
  const Measurable high{.voltage_v = {.a = 100.0}};
  const Measurable low{.voltage_v = {.a = -100.0}};
  bank.follow(m, 0.0, 0.6 * kTick_s, high, high);
  bank.follow(m, 0.6 * kTick_s, 0.4 * kTick_s, low, low);
  bank.end_tick(m, low, 1);
  EXPECT_EQ(bank.readings(m, {}, 1).u_a_v, 100.0);
}

// y' = (x - y)/T behind x = 7 + s t: closed form to rounding, in even steps, in steps that events cut, and
// with the sample in the middle of the tick. Catches: a corner in rad/s, Euler or trapezoidal steps, a step
// of the usual length where another one was, a middle without its filter.
TEST(SensorFilter, TheFilterIsExactForStraightLinesInAnySteps) {
  constexpr double kSlope = 2e3;
  constexpr double kCorner_hz = 800.0;
  const double time_constant_s = 1.0 / (2.0 * std::numbers::pi * kCorner_hz);
  const auto exact = [&](double t) {
    return 7.0 * -std::expm1(-t / time_constant_s) +
           kSlope * (t + time_constant_s * std::expm1(-t / time_constant_s));
  };
  const auto ramp = [](double t) { return current_point(7.0 + kSlope * t); };
  for (const double delay_ticks : {0.0, 0.5, 3.0}) {
    SensorParameters p;
    p.current.filter_hz = kCorner_hz;
    p.current.delay_ticks = delay_ticks;
    for (const std::vector<double>& nodes_s :
         {even_nodes(10), even_nodes(5), {0.0, 0.123 * kTick_s, 0.7 * kTick_s, kTick_s}}) {
      const SensorBank bank = bank_of(p);
      SensorMemory m;
      for (Tick tick = 0; tick < 30; ++tick) {
        run_tick(bank, m, tick, nodes_s, ramp);
        const double sampled_s = (static_cast<double>(tick) + 1.0 - delay_ticks) * kTick_s;
        if (sampled_s < 0.0) continue;
        ASSERT_NEAR(bank.readings(m, {}, tick + 1).i_a_a, exact(sampled_s), 1e-13);
      }
    }
  }
}

// Each section with another corner: a step of 1 settles to 1 - exp(-w t), in steps of the usual length and
// others. Catches: the coefficients of one section used for the next, a channel without its filter.
TEST(SensorFilter, EverySectionHasItsOwnFilter) {
  SensorParameters p = all_on();
  p.tachometer.gain_vs_per_rad = 1.0;
  p.current.filter_hz = 100.0;
  p.voltage.filter_hz = 200.0;
  p.bus.filter_hz = 300.0;
  p.neutral.filter_hz = 400.0;
  p.temperature.filter_hz = 500.0;
  p.tachometer.analog.filter_hz = 600.0;
  p.resolver.analog.filter_hz = 700.0;
  const Measurable one{.current_a = {.a = 1.0, .b = 1.0, .c = 1.0, .field = 1.0},
                       .voltage_v = {.a = 1.0, .b = 1.0, .c = 1.0, .field = 1.0},
                       .bus_v = 1.0,
                       .neutral_v = 1.0,
                       .temperature_k = 1.0,
                       .angle_rad = 0.25 * std::numbers::pi,
                       .speed_rad_s = 1.0};
  for (const std::vector<double>& nodes_s : {even_nodes(10), even_nodes(3)}) {
    const SensorBank bank = bank_of(p);
    SensorMemory m;
    for (Tick tick = 0; tick < 12; ++tick)
      run_tick(bank, m, tick, nodes_s, [&](double) { return one; });
    const Sample r = bank.readings(m, {}, 12);
    const auto settled = [](double corner_hz) {
      return -std::expm1(-2.0 * std::numbers::pi * corner_hz * 12.0 * kTick_s);
    };
    for (const double current_a : {r.i_a_a, r.i_b_a, r.i_c_a, r.i_f_a})
      EXPECT_NEAR(current_a, settled(100.0), 1e-13);
    for (const double voltage_v : {r.u_a_v, r.u_b_v, r.u_c_v, r.u_f_v})
      EXPECT_NEAR(voltage_v, settled(200.0), 1e-13);
    EXPECT_NEAR(r.bus_voltage_v, settled(300.0), 1e-13);
    EXPECT_NEAR(r.u_n_v, settled(400.0), 1e-13);
    EXPECT_NEAR(r.temperature_k, settled(500.0), 1e-13);
    EXPECT_NEAR(r.tachometer_v, settled(600.0), 1e-13);
    EXPECT_NEAR(r.resolver_sin_v, std::sqrt(0.5) * settled(700.0), 1e-13);
    EXPECT_NEAR(r.resolver_cos_v, std::sqrt(0.5) * settled(700.0), 1e-13);
  }
}

// At 50 rad/s the resolver's sine lags by atan(w T) and shrinks to 1/sqrt(1 + (w T)²), and the speed passes
// unchanged. Between nodes the sine counts as straight: (w h)²/12 = 2e-8. Catches: the angle of the
// interval's end at its start, sine and cosine that share one memory.
TEST(SensorFilter, AFilteredResolverLagsAsTheFilterSays) {
  SensorParameters p = all_on();
  p.resolver.analog.filter_hz = 20.0;
  p.tachometer.analog.filter_hz = 20.0;
  const SensorBank bank = bank_of(p);
  constexpr double kSpeed_rad_s = 50.0;
  const auto shaft = [](double t) {
    return Measurable{.angle_rad = std::fmod(kSpeed_rad_s * t, 2.0 * std::numbers::pi),
                      .speed_rad_s = kSpeed_rad_s};
  };
  SensorMemory m;
  constexpr Tick kTicks = 3000;  // 38 time constants
  for (Tick tick = 0; tick < kTicks; ++tick) {
    // The nodes of one tick lie in one turn; a turn ends between two ticks.
    const double turn = std::floor(shaft(static_cast<double>(tick) * kTick_s).angle_rad / 6.2);
    run_tick(bank, m, tick, even_nodes(10), [&](double t) {
      Measurable x = shaft(t);
      if (turn > 0.0 && x.angle_rad < 1.0) x.angle_rad += 2.0 * std::numbers::pi;
      return x;
    });
  }
  const double w_t = kSpeed_rad_s / (2.0 * std::numbers::pi * 20.0);
  const double angle_rad = kSpeed_rad_s * kTicks * kTick_s - std::atan(w_t);
  const Sample r = bank.readings(m, {}, kTicks);
  EXPECT_NEAR(r.resolver_sin_v, std::sin(angle_rad) / std::hypot(1.0, w_t), 5e-8);
  EXPECT_NEAR(r.resolver_cos_v, std::cos(angle_rad) / std::hypot(1.0, w_t), 5e-8);
  EXPECT_NEAR(r.tachometer_v, 0.1 * kSpeed_rad_s, 1e-12);
}

}  // namespace
}  // namespace drivebench::sensor_filter_test
