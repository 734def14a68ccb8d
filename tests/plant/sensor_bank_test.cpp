#include "plant/sensors/sensor_bank.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "plant/faults.hpp"
#include "plant/math/noise.hpp"
#include "tests/plant/sensor_point.hpp"

namespace drivebench::sensor_bank_test {
namespace {

using namespace sensor_point;

// Catches: a channel that shows another one's quantity, is left out, or swallows its gain.
TEST(SensorBank, EveryIdealChannelShowsItsOwnQuantity) {
  const SensorBank bank = bank_of(all_on());
  SensorMemory m;
  bank.end_tick(m, kPoint, 1);
  const Sample r = bank.readings(m, {}, 1);
  EXPECT_EQ(r.i_a_a, 1.0);
  EXPECT_EQ(r.i_b_a, 2.0);
  EXPECT_EQ(r.i_c_a, 3.0);
  EXPECT_EQ(r.i_f_a, 4.0);
  EXPECT_EQ(r.u_a_v, 5.0);
  EXPECT_EQ(r.u_b_v, 6.0);
  EXPECT_EQ(r.u_c_v, 7.0);
  EXPECT_EQ(r.u_f_v, 8.0);
  EXPECT_EQ(r.bus_voltage_v, 9.0);
  EXPECT_EQ(r.u_n_v, 10.0);
  EXPECT_EQ(r.temperature_k, 11.0);
  EXPECT_EQ(r.tachometer_v, 0.1 * 12.0);
  EXPECT_EQ(r.resolver_sin_v, sine(0.5));
  EXPECT_EQ(r.resolver_cos_v, cosine(0.5));
  EXPECT_EQ(r.faults, 0u);
}

// Catches: a sensor that is off and still speaks, or one that hides the true voltages of the bench.
TEST(SensorBank, AChannelThatIsOffReadsZeroButVoltagesAndBusAreTheTrueOnes) {
  SensorParameters p;
  p.voltage = {.bits = 3, .gain = 2.0, .offset = 1.0, .noise_rms = 1.0, .delay_ticks = 4.0};
  p.bus = p.neutral = p.temperature = p.tachometer.analog = p.resolver.analog = p.voltage;
  p.tachometer.gain_vs_per_rad = 1.0;
  const SensorBank bank = bank_of(p);
  SensorMemory m;
  bank.end_tick(m, kPoint, 1);
  const Sample r = bank.readings(m, {}, 1);
  EXPECT_EQ(r.i_c_a, 3.0);
  EXPECT_EQ(r.u_a_v, 5.0);
  EXPECT_EQ(r.u_f_v, 8.0);
  EXPECT_EQ(r.bus_voltage_v, 9.0);
  EXPECT_EQ(r.u_n_v, 0.0);
  EXPECT_EQ(r.temperature_k, 0.0);
  EXPECT_EQ(r.tachometer_v, 0.0);
  EXPECT_EQ(r.resolver_sin_v, 0.0);
  EXPECT_EQ(r.resolver_cos_v, 0.0);
  EXPECT_FALSE(bank.follows());
}

// Catches: noise or offset on the wire of a phase that does not exist.
TEST(SensorBank, TerminalsThatTheMachineDoesNotHaveReadZero) {
  SensorParameters p = all_on();
  p.current.noise_rms_a = p.voltage.noise_rms = 1.0;
  p.current.offset_a_a = p.current.offset_b_a = p.current.offset_c_a = p.voltage.offset = 0.5;
  for (const Connection connection :
       {Connection::kArmature, Connection::kTwoPhase, Connection::kIndependent}) {
    const int terminals = terminal_count(connection);
    for (const bool has_field : {false, true}) {
      const SensorBank bank(p, connection, kTick_s, kSeed, 0, 0.0, has_field);
      const Sample r = bank.readings({}, {}, 3);
      EXPECT_NE(r.i_a_a, 0.0);
      EXPECT_EQ(r.i_b_a != 0.0, terminals > 1);
      EXPECT_EQ(r.i_c_a != 0.0, terminals > 2);
      EXPECT_EQ(r.u_b_v != 0.0, terminals > 1);
      EXPECT_EQ(r.u_c_v != 0.0, terminals > 2);
      EXPECT_EQ(r.i_f_a != 0.0, has_field);
      EXPECT_EQ(r.u_f_v != 0.0, has_field);
    }
  }
}

// Catches: gains and offsets of the phases or windings exchanged, a first reading that is not defined.
TEST(SensorBank, BeforeTheFirstTickZerosGoThroughGainsAndOffsets) {
  SensorParameters p = all_on();
  p.current.offset_a_a = 0.1;
  p.current.offset_b_a = 0.2;
  p.current.offset_c_a = 0.3;
  p.current.gain_a = 2.0;
  p.current.gain_b = 3.0;
  p.current.gain_c = 4.0;
  p.bus.offset = 0.4;
  p.resolver.analog.offset = 1.0;
  p.resolver.sine_offset_v = 0.5;
  p.resolver.cosine_offset_v = 0.6;
  const SensorBank bank = bank_of(p);
  SensorMemory m;
  Sample r = bank.readings(m, {}, 0);
  EXPECT_EQ(r.i_a_a, 0.1);
  EXPECT_EQ(r.i_b_a, 0.2);
  EXPECT_EQ(r.i_c_a, 0.3);
  EXPECT_EQ(r.bus_voltage_v, 0.4);
  EXPECT_EQ(r.resolver_sin_v, 1.5);
  EXPECT_EQ(r.resolver_cos_v, 1.6);
  bank.end_tick(m, kPoint, 1);
  r = bank.readings(m, {}, 1);
  EXPECT_EQ(r.i_a_a, 2.1);
  EXPECT_EQ(r.i_b_a, 6.2);
  EXPECT_EQ(r.i_c_a, 12.3);
}

// Catches: a ring that is too short, a delay that is one tick off, a delay of one section on another.
TEST(SensorBank, ADelayOfWholeTicksShowsThatTick) {
  for (int delay = 0; delay <= kMaxSensorDelayTicks; ++delay) {
    SensorParameters p = all_on();
    p.current.delay_ticks = delay;
    p.bus.delay_ticks = kMaxSensorDelayTicks - delay;
    const SensorBank bank = bank_of(p);
    EXPECT_FALSE(bank.follows());
    SensorMemory m;
    for (Tick tick = 1; tick < 40; ++tick) {
      Measurable x = current_point(static_cast<double>(tick));
      x.bus_v = static_cast<double>(tick);
      bank.end_tick(m, x, tick);
      const Sample r = bank.readings(m, {}, tick);
      EXPECT_EQ(r.i_a_a, static_cast<double>(std::max<Tick>(tick - delay, 0)));
      EXPECT_EQ(r.bus_voltage_v, static_cast<double>(std::max<Tick>(tick - kMaxSensorDelayTicks + delay, 0)));
    }
  }
}

// A plant that has stopped (diverged) holds its last outputs. Catches: old ticks that come round again.
TEST(SensorBank, WithoutNewTicksTheReadingsStay) {
  SensorParameters p;
  p.current.delay_ticks = 2.0;
  const SensorBank bank = bank_of(p);
  SensorMemory m;
  for (Tick tick = 1; tick <= 20; ++tick)
    bank.end_tick(m, current_point(static_cast<double>(tick)), tick);
  for (Tick tick = 20; tick < 50; ++tick)
    EXPECT_EQ(bank.readings(m, {}, tick).i_a_a, 18.0);
}

// Catches: one noise for two channels, noise that depends on the order of calls, a channel number that moves.
TEST(SensorBank, TheNoiseIsThatOfSeedChannelAndTick) {
  SensorParameters p = all_on();
  p.current.noise_rms_a = 2.0;
  for (AnalogParameters* analog :
       {&p.voltage, &p.neutral, &p.bus, &p.temperature, &p.tachometer.analog, &p.resolver.analog})
    analog->noise_rms = 2.0;
  const SensorBank bank = bank_of(p);
  for (const Tick tick : {7, 3, 7}) {
    const Sample r = bank.readings({}, {}, tick);
    const std::array<double, kChannelCount> read{
        r.i_a_a,         r.i_b_a,        r.i_c_a,          r.i_f_a,         r.u_a_v,
        r.u_b_v,         r.u_c_v,        r.u_f_v,          r.bus_voltage_v, r.u_n_v,
        r.temperature_k, r.tachometer_v, r.resolver_sin_v, r.resolver_cos_v};
    for (std::size_t n = 0; n < kChannelCount; ++n)
      EXPECT_EQ(read[n], 2.0 * gaussian_noise(kSeed, kNoiseChannel + n, static_cast<std::uint64_t>(tick)));
  }
}

// Catches: a fault on the wrong phase, one that the gain of the sensor scales, an offset on the field
// current.
TEST(SensorBank, FaultsOfCurrentSensorsActOnTheirReadings) {
  SensorParameters p;
  p.current.gain_a = 2.0;
  p.current.offset_b_a = 0.25;
  const SensorBank bank = bank_of(p);
  SensorMemory m;
  bank.end_tick(m, kPoint, 1);
  Sample r = bank.readings(m, {.current_sensor_gain = -0.5}, 1);
  EXPECT_EQ(r.i_a_a, 1.0);
  EXPECT_EQ(r.i_b_a, 1.25);
  EXPECT_EQ(r.i_c_a, 1.5);
  EXPECT_EQ(r.i_f_a, 2.0);
  r = bank.readings(m, {.current_sensor_offset = 3.0}, 1);
  EXPECT_EQ(r.i_a_a, 5.0);
  EXPECT_EQ(r.i_b_a, 5.25);
  EXPECT_EQ(r.i_c_a, 6.0);
  EXPECT_EQ(r.i_f_a, 4.0);
  for (int phase = 1; phase <= 3; ++phase) {
    r = bank.readings(m, {.current_sensor_offset = 3.0, .current_sensor_stuck = static_cast<double>(phase)},
                      1);
    EXPECT_EQ(r.i_a_a, phase == 1 ? 0.0 : 5.0);
    EXPECT_EQ(r.i_b_a, phase == 2 ? 0.0 : 5.25);
    EXPECT_EQ(r.i_c_a, phase == 3 ? 0.0 : 6.0);
  }
}

// Catches: a burst that replaces the noise of the sensor, that reaches the field current, or that stays.
TEST(SensorBank, ANoiseBurstAddsToTheNoiseOfThePhases) {
  SensorParameters p;
  p.current.noise_rms_a = 0.5;
  const SensorBank bank = bank_of(p);
  SensorMemory m;
  bank.end_tick(m, kPoint, 1);
  const Sample before = bank.readings(m, {}, 1);
  const Sample r = bank.readings(m, {.current_sensor_noise = 2.0}, 1);
  const auto noise = [](std::uint64_t channel) { return gaussian_noise(kSeed, kNoiseChannel + channel, 1); };
  EXPECT_DOUBLE_EQ(r.i_a_a, kPoint.current_a.a + 2.5 * noise(0));
  EXPECT_DOUBLE_EQ(r.i_b_a, kPoint.current_a.b + 2.5 * noise(1));
  EXPECT_DOUBLE_EQ(r.i_c_a, kPoint.current_a.c + 2.5 * noise(2));
  EXPECT_EQ(r.i_f_a, before.i_f_a);
  EXPECT_EQ(bank.readings(m, {}, 1).i_a_a, before.i_a_a);
}

// Catches: an open winding that takes the other one along or its offset with it.
TEST(SensorBank, FaultsOfTachometerAndResolverActOnTheirReadings) {
  SensorParameters p = all_on();
  p.tachometer.analog.offset = 0.3;
  p.resolver.sine_offset_v = 0.1;
  const SensorBank bank = bank_of(p);
  SensorMemory m;
  bank.end_tick(m, kPoint, 1);
  Sample r = bank.readings(m, {.tachometer_loss = 1.0}, 1);
  EXPECT_EQ(r.tachometer_v, 0.3);
  EXPECT_EQ(r.resolver_sin_v, sine(0.5) + 0.1);
  r = bank.readings(m, {.resolver_loss = 1.0}, 1);
  EXPECT_EQ(r.tachometer_v, 0.1 * 12.0 + 0.3);
  EXPECT_EQ(r.resolver_sin_v, 0.1);
  EXPECT_EQ(r.resolver_cos_v, cosine(0.5));
  r = bank.readings(m, {.resolver_loss = 2.0}, 1);
  EXPECT_EQ(r.resolver_sin_v, sine(0.5) + 0.1);
  EXPECT_EQ(r.resolver_cos_v, 0.0);
}

// Catches: a voltage at the end of its converter that is reported as a current, a flag that is never set.
TEST(SensorBank, AConverterAtItsEndIsReportedForCurrentsAndForTheRest) {
  SensorParameters p = all_on();
  p.current.bits = p.bus.bits = 8;
  p.current.full_scale_a = p.bus.full_scale = 100.0;
  const SensorBank bank = bank_of(p);
  const auto flags = [&](double field_a, double bus_v) {
    SensorMemory m;
    bank.end_tick(m, {.current_a = {.field = field_a}, .bus_v = bus_v}, 1);
    return bank.readings(m, {}, 1).faults;
  };
  EXPECT_EQ(flags(99.0, 99.0), 0u);
  EXPECT_EQ(flags(101.0, 99.0), kCurrentSensorSaturated);
  EXPECT_EQ(flags(99.0, -101.0), kSensorSaturated);
}

// Catches: a start at which filters and delays still show zeros.
TEST(SensorBank, ASettledBankReadsTheConstantStateBefore) {
  SensorParameters p = all_on();
  p.bus.filter_hz = 5.0;
  p.current.delay_ticks = 8.0;
  p.temperature.delay_ticks = 0.5;
  p.resolver.analog.filter_hz = 3.0;
  const SensorBank bank = bank_of(p);
  SensorMemory m = bank.settled(kPoint, 3);
  for (Tick tick = 3; tick < 6; ++tick) {
    const Sample r = bank.readings(m, {}, tick);
    EXPECT_EQ(r.bus_voltage_v, 9.0);
    EXPECT_EQ(r.i_b_a, 2.0);
    EXPECT_EQ(r.temperature_k, 11.0);
    EXPECT_EQ(r.resolver_sin_v, sine(0.5));
    run_tick(bank, m, tick, even_nodes(10), [](double) { return kPoint; });
  }
}

// A window of 3 ticks. Catches: figures that run within the window, a window that is a tick too long, one
// that carries the last one's sums.
TEST(SensorBank, TheMeterShowsEachWholeWindowUntilTheNext) {
  SensorParameters p;
  p.meter = {.enabled = true, .window_s = 3.0 * kTick_s};
  const SensorBank bank = bank_of(p, Connection::kArmature);
  EXPECT_TRUE(bank.follows());
  SensorMemory m;
  for (Tick tick = 0; tick < 12; ++tick) {
    const double volts = static_cast<double>(1 + tick / 3);
    run_tick(bank, m, tick, even_nodes(4),
             [&](double) { return Measurable{.current_a = {.a = 2.0}, .voltage_v = {.a = volts}}; });
    const Sample r = bank.readings(m, {}, tick + 1);
    const double shown = static_cast<double>((tick + 1) / 3);
    EXPECT_NEAR(r.meter_u_rms_v, shown, 1e-12);
    EXPECT_NEAR(r.meter_i_rms_a, tick < 2 ? 0.0 : 2.0, 1e-12);
    EXPECT_NEAR(r.meter_p_w, 2.0 * shown, 1e-12);
    EXPECT_NEAR(r.meter_q_var, 0.0, 1e-6);
    EXPECT_NEAR(r.meter_pf, tick < 2 ? 0.0 : 1.0, 1e-12);
  }
}

}  // namespace
}  // namespace drivebench::sensor_bank_test
