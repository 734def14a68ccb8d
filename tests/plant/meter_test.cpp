#include "plant/sensors/meter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace drivebench::meter_test {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;

/// Sines in steady state: peak voltage and current of each phase, the current behind by lag_rad.
struct Steady {
  Connection connection;
  double voltage_v;
  double current_a;
  double lag_rad;
  double frequency_hz = 60.0;  ///< negative: phases in the order a, c, b
  double zero_v = 0.0;         ///< of the third harmonic that all phases share

  PhaseValues at(double time_s, double amplitude, double lag, double zero) const {
    const double phase = kTurn_rad * frequency_hz * time_s;
    const double shift = connection == Connection::kTwoPhase ? kTurn_rad / 4 : kTurn_rad / 3;
    const double common = zero * std::cos(3.0 * phase);
    const double sign = frequency_hz < 0.0 ? -1.0 : 1.0;
    PhaseValues x{.a = amplitude * std::cos(phase - sign * lag) + common};
    if (connection != Connection::kArmature) {
      x.b = amplitude * std::cos(phase - sign * lag - shift) + common;
    }
    if (terminal_count(connection) == 3) {
      x.c = amplitude * std::cos(phase - sign * lag - 2.0 * shift) + common;
    }
    return x;
  }
};

/// The figures after this many periods in intervals of step_s, which divide the time.
MeterFigures measured(const Steady& s, double step_s, int periods = 6) {
  MeterSums sums;
  const auto steps = std::lround(periods / std::abs(s.frequency_hz) / step_s);
  for (long n = 0; n < steps; ++n) {
    const double from = static_cast<double>(n) * step_s;
    const double to = static_cast<double>(n + 1) * step_s;
    const PhaseValues u0 = s.at(from, s.voltage_v, 0.0, s.zero_v);
    const PhaseValues u1 = s.at(to, s.voltage_v, 0.0, s.zero_v);
    const PhaseValues i0 = s.at(from, s.current_a, s.lag_rad, 0.0);
    const PhaseValues i1 = s.at(to, s.current_a, s.lag_rad, 0.0);
    add_interval(sums, s.connection, step_s, {u0, i0}, {u1, i1});
  }
  return figures_of(sums, s.connection);
}

// The blocked-rotor point of motor IM-B (P3-08): 208 V line to line, 8.41 A, power factor 0.2546. Six periods
// of 60 Hz in 100 ms: the sums are exact for sines, what is left is rounding. Catches: chords in place of
// the trapezoidal rule (1.2e-4 at 100 us), line-to-line voltages, a factor 3/2, a power of one phase.
TEST(Meter, TheBlockedRotorTestReadsToRoundingAtAnyStep) {
  const double lag_rad = std::acos(0.25455);
  const Steady blocked{Connection::kStar, 208.0 * std::sqrt(2.0 / 3.0), 8.41017 * std::sqrt(2.0), lag_rad};
  for (const double step_s : {25e-6, 50e-6, 100e-6}) {
    const MeterFigures f = measured(blocked, step_s);
    EXPECT_NEAR(f.voltage_v, 208.0 / std::sqrt(3.0), 1e-10);
    EXPECT_NEAR(f.current_a, 8.41017, 1e-11);
    EXPECT_NEAR(f.power_w, std::sqrt(3.0) * 208.0 * 8.41017 * 0.25455, 1e-8);
    EXPECT_NEAR(f.reactive_var, std::sqrt(3.0) * 208.0 * 8.41017 * std::sin(lag_rad), 1e-8);
    EXPECT_NEAR(f.power_factor, 0.25455, 1e-12);
  }
}

// Catches: a number of phases that is not that of the machine, a sign that turns with the phase order, a lead
// that reads as a lag, a negative power that loses its sign.
TEST(Meter, InductiveIsPositiveInEveryConnectionAndEitherDirection) {
  for (const Connection connection :
       {Connection::kArmature, Connection::kTwoPhase, Connection::kStar, Connection::kIndependent}) {
    for (const double frequency_hz : {60.0, -60.0}) {
      for (const double lag_rad : {-2.5, -0.7, 0.3, 1.2, 2.0}) {
        const MeterFigures f = measured({connection, 100.0, 5.0, lag_rad, frequency_hz}, 50e-6);
        const double apparent_va = terminal_count(connection) * 250.0;
        EXPECT_NEAR(f.voltage_v, 100.0 / std::sqrt(2.0), 1e-9);
        EXPECT_NEAR(f.current_a, 5.0 / std::sqrt(2.0), 1e-10);
        EXPECT_NEAR(f.power_w, apparent_va * std::cos(lag_rad), 1e-7);
        EXPECT_NEAR(f.reactive_var, apparent_va * std::sin(lag_rad), 1e-6);
        EXPECT_NEAR(f.power_factor, std::cos(lag_rad), 1e-10);
      }
    }
  }
}

// In a star the common voltage of the terminals moves the neutral only; independent windings see it. Catches:
// a voltage of the star against the middle of the link, a zero sequence that is lost where it counts.
TEST(Meter, ACommonVoltageCountsOnlyWhereTheWindingsSeeIt) {
  const MeterFigures star = measured({Connection::kStar, 100.0, 5.0, 0.3, 50.0, 30.0}, 50e-6);
  EXPECT_NEAR(star.voltage_v, std::sqrt(5000.0), 1e-9);
  EXPECT_NEAR(star.power_w, 750.0 * std::cos(0.3), 1e-7);
  const MeterFigures independent = measured({Connection::kIndependent, 100.0, 5.0, 0.3, 50.0, 30.0}, 50e-6);
  EXPECT_NEAR(independent.voltage_v, std::sqrt(5000.0 + 450.0), 1e-9);
  EXPECT_NEAR(independent.power_w, 750.0 * std::cos(0.3), 1e-7);
}

// A bridge: the voltage jumps between the intervals and the current is a triangle between 2 A and 6 A, whose
// corners are the only nodes. Closed forms: mean square 16 + 4/3 A², rms voltage 50 V. Catches: the
// trapezoidal rule for the current (20 A²), an end of the interval taken for the start of the next.
TEST(Meter, TheRippleOfABridgeIsIntegratedExactlyFromCornerToCorner) {
  MeterSums sums;
  for (int n = 0; n < 10; ++n) {
    add_interval(sums, Connection::kArmature, 30e-6, {{.a = 50.0}, {.a = 2.0}}, {{.a = 50.0}, {.a = 6.0}});
    add_interval(sums, Connection::kArmature, 10e-6, {{.a = -50.0}, {.a = 6.0}}, {{.a = -50.0}, {.a = 2.0}});
  }
  const MeterFigures f = figures_of(sums, Connection::kArmature);
  EXPECT_NEAR(f.voltage_v, 50.0, 1e-12);
  EXPECT_NEAR(f.current_a, std::sqrt(16.0 + 4.0 / 3.0), 1e-12);
  EXPECT_NEAR(f.power_w, 100.0, 1e-11);  // 4 A at a mean of 25 V
}

// Catches: a division by zero, a root of a negative number.
TEST(Meter, NoCurrentReadsAsZeroAndADirectCurrentHasNoReactivePower) {
  EXPECT_EQ(figures_of({}, Connection::kStar).power_factor, 0.0);
  MeterSums sums;
  add_interval(sums, Connection::kTwoPhase, 1e-3, {{}, {}}, {{}, {}});
  EXPECT_EQ(figures_of(sums, Connection::kTwoPhase).power_factor, 0.0);
  for (int k = 1; k <= 50; ++k) {
    sums = {};
    const PhaseValues u{.a = 0.3 * k};
    const PhaseValues i{.a = 0.7};
    for (int n = 0; n < 100; ++n)
      add_interval(sums, Connection::kArmature, 1e-4, {u, i}, {u, i});
    const MeterFigures f = figures_of(sums, Connection::kArmature);
    EXPECT_NEAR(f.power_w, 0.21 * k, 1e-12);
    EXPECT_NEAR(f.reactive_var, 0.0, 1e-6);  // the root of a rounding error of either sign
    EXPECT_NEAR(f.power_factor, 1.0, 1e-13);
  }
}

}  // namespace
}  // namespace drivebench::meter_test
