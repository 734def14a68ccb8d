#include "plant/thermal.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace drivebench::thermal_test {
namespace {

constexpr ThermalParameters kMotor{
    .enabled = true, .resistance_k_per_w = 1.5, .time_constant_s = 600.0, .ambient_k = 298.0};
constexpr double kTick_s = 100e-6;

// 100 s of 40 W in 1e6 ticks against the closed form. A tick closes 1.7e-7 of the gap and rounds at 2.8e-14
// K, as if the settled temperature were wrong by 1.7e-7 K at most. Catches: an Euler step (7e-7 K), a loss in
// watts, heat that forgets the ambient temperature.
TEST(Thermal, AMillionTicksEndWhereTheClosedFormDoes) {
  ThermalState state{.temperature_k = 298.0};
  for (int n = 0; n < 1'000'000; ++n)
    advance(kMotor, state, 40.0 * kTick_s, kTick_s);
  EXPECT_NEAR(state.temperature_k, 298.0 - 60.0 * std::expm1(-100.0 / 600.0), 2e-7);
}

// Steps of a third of the time constant and of three of them. Catches: any step but the exponential one.
TEST(Thermal, LongStepsAreExactToo) {
  for (const double step_s : {200.0, 1800.0}) {
    ThermalState state{.temperature_k = 350.0};
    for (int n = 1; n <= 5; ++n) {
      advance(kMotor, state, 20.0 * step_s, step_s);
      EXPECT_NEAR(state.temperature_k, 328.0 + 22.0 * std::exp(-n * step_s / 600.0), 1e-12);
    }
  }
}

// Catches: a drift of a body that has nothing to do.
TEST(Thermal, AColdMotorStaysAtTheAmbientTemperatureToTheLastBit) {
  ThermalState state{.temperature_k = kMotor.ambient_k};
  for (int n = 0; n < 1'000'000; ++n)
    advance(kMotor, state, 0.0, kTick_s);
  EXPECT_EQ(state.temperature_k, kMotor.ambient_k);
}

// Copper grows by 39.3 % in 100 K, aluminium by 40.3 %. Catches: coefficients exchanged, ambient for
// reference, factors of a motor whose heat is not modelled.
TEST(Thermal, ResistancesGrowFromTheReferenceTemperature) {
  ThermalParameters p = kMotor;
  p.reference_k = 293.0;
  Adjustment a = thermal_adjustment(p, {.temperature_k = 393.0});
  EXPECT_DOUBLE_EQ(a.stator_resistance_factor, 1.393);
  EXPECT_DOUBLE_EQ(a.rotor_resistance_factor, 1.403);
  EXPECT_EQ(a.magnet_factor, 1.0);
  a = thermal_adjustment(p, {.temperature_k = 293.0});
  EXPECT_EQ(a.stator_resistance_factor, 1.0);
  EXPECT_EQ(a.rotor_resistance_factor, 1.0);
  p.enabled = false;
  a = thermal_adjustment(p, {.temperature_k = 393.0});
  EXPECT_EQ(a.stator_resistance_factor, 1.0);
  EXPECT_EQ(a.rotor_resistance_factor, 1.0);
}

}  // namespace
}  // namespace drivebench::thermal_test
