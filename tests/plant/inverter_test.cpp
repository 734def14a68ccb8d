#include "plant/drive/inverter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include "tests/plant/drive_rig.hpp"

namespace drivebench::inverter_test {
namespace {

constexpr double kBus_v = 300.0;

ThreePhase phases_of_vector(double length_v, double angle_rad) {
  const double third = 2.0 * std::numbers::pi / 3.0;
  return {length_v * std::cos(angle_rad), length_v * std::cos(angle_rad - third),
          length_v * std::cos(angle_rad + third)};
}

DriveParameters inverter(DriveKind kind, double dead_time_s = 0.0) {
  DriveParameters p = plain_drive(kind);
  p.bus.voltage_v = kBus_v;
  p.inverter.dead_time_s = dead_time_s;
  return p;
}

// A vector of up to V/sqrt(3) = 173.2 V passes at every angle; in the corners of the hexagon 2 V/3 = 200 V
// do. Catches: a limit of half the link (no injection), a circle instead of the hexagon, a flag without
// clipping.
TEST(Inverter, TheHexagonIsTheLimitOfAStar) {
  const double inner_v = kBus_v / std::numbers::sqrt3;
  for (int degree = 0; degree < 360; degree += 5) {
    const double angle_rad = degree * std::numbers::pi / 180.0;
    EXPECT_FALSE(
        bridge_voltages(Connection::kStar, kBus_v, phases_of_vector(0.9999 * inner_v, angle_rad)).saturated);
    const bool corner = degree % 60 == 0;
    EXPECT_EQ(
        bridge_voltages(Connection::kStar, kBus_v, phases_of_vector(0.999 * 200.0, angle_rad)).saturated,
        !corner);
    const bool flat = degree % 60 == 30;
    EXPECT_EQ(
        bridge_voltages(Connection::kStar, kBus_v, phases_of_vector(1.0001 * inner_v, angle_rad)).saturated,
        flat);
  }
}

// Catches: phases clipped one by one (which turns the vector), a shift that is not common, terminals beyond
// the rails.
TEST(Inverter, ALimitedVectorKeepsItsAngle) {
  std::mt19937_64 engine(4);
  std::uniform_real_distribution<double> length(0.0, 900.0);
  std::uniform_real_distribution<double> angle(-3.2, 3.2);
  for (int n = 0; n < 1000; ++n) {
    const ThreePhase wanted = phases_of_vector(length(engine), angle(engine));
    const double common = length(engine) - 450.0;
    const LimitedVoltages out =
        bridge_voltages(Connection::kStar, kBus_v, {wanted.a + common, wanted.b + common, wanted.c + common});
    const auto [low, high] = std::minmax({out.voltage_v.a, out.voltage_v.b, out.voltage_v.c});
    EXPECT_NEAR(low, -high, 1e-10);  // min-max injection
    EXPECT_LE(high - low, kBus_v * (1.0 + 1e-14));
    const TwoPhase v = three_to_two(out.voltage_v);
    const TwoPhase w = three_to_two(wanted);
    EXPECT_NEAR(v.a * w.b, v.b * w.a, 1e-8);
    EXPECT_GE(v.a * w.a + v.b * w.b, 0.0);
    if (out.saturated) {
      EXPECT_NEAR(high - low, kBus_v, 1e-10);
    } else {
      EXPECT_NEAR(v.a, w.a, 1e-10);
      EXPECT_NEAR(v.b, w.b, 1e-10);
    }
  }
}

// Catches: a winding of its own that gets half the link, an injection between windings that have no common
// point.
TEST(Inverter, AWindingBetweenTwoLegsHasTheWholeLink) {
  const LimitedVoltages out = bridge_voltages(Connection::kIndependent, kBus_v, {299.0, -400.0, 10.0});
  EXPECT_EQ(out.voltage_v.a, 299.0);
  EXPECT_EQ(out.voltage_v.b, -300.0);
  EXPECT_EQ(out.voltage_v.c, 10.0);
  EXPECT_TRUE(out.saturated);
}

// Catches: a pulse as long as the dead time that is still switched, a duty outside of 0 .. 1, a division by a
// link of 0 V.
TEST(Inverter, PulsesThatVanishInTheDeadTimeAreLeftOut) {
  EXPECT_EQ(duty(0.0, 150.0, 0.1), 0.5);
  EXPECT_EQ(duty(75.0, 150.0, 0.1), 0.75);
  EXPECT_EQ(duty(-125.0, 150.0, 0.1), 0.0);  // 1/12 of the period
  EXPECT_GT(duty(-115.0, 150.0, 0.1), 0.1);
  EXPECT_EQ(duty(125.0, 150.0, 0.1), 1.0);
  EXPECT_EQ(duty(150.0, 150.0, 0.0), 1.0);
  EXPECT_EQ(duty(-150.0, 150.0, 0.0), 0.0);
  EXPECT_EQ(duty(1.0, 150.0, 0.7), 1.0);
  EXPECT_EQ(duty(0.0, 0.0, 0.0), 0.5);
}

// Catches: an error that helps the current, one of a single rail, a jump at zero current, an error of a leg
// that does not switch.
TEST(Inverter, TheDeadTimeTakesVoltageFromTheCurrent) {
  constexpr double kPart = 0.02;
  constexpr double kBand_a = 0.1;
  EXPECT_EQ(averaged_voltage_v(40.0, 150.0, kPart, 5.0, kBand_a), 40.0 - 6.0);
  EXPECT_EQ(averaged_voltage_v(40.0, 150.0, kPart, -5.0, kBand_a), 40.0 + 6.0);
  EXPECT_EQ(averaged_voltage_v(40.0, 150.0, kPart, 0.0, kBand_a), 40.0);
  EXPECT_NEAR(averaged_voltage_v(40.0, 150.0, kPart, 0.05, kBand_a), 37.0, 1e-12);
  EXPECT_EQ(averaged_voltage_v(150.0, 150.0, kPart, 5.0, kBand_a), 150.0);
  EXPECT_EQ(averaged_voltage_v(-149.0, 150.0, kPart, -5.0, kBand_a), -150.0);
  EXPECT_EQ(averaged_voltage_v(40.0, 150.0, 0.0, 5.0, kBand_a), 40.0);
}

/// Follows a pattern from edge to edge: seconds at the upper rail and on the diodes.
struct Times {
  double high_s[3]{};
  double dead_s[3]{};
  double first_high_s[3]{-1.0, -1.0, -1.0};
  double last_high_s[3]{};
  int edges = 0;
};

SwitchingPattern pattern_of(const ThreePhase& voltage_v, int terminals, double rail_v, double dead_time_s,
                            double period_s) {
  SwitchingPattern pattern;
  pattern.set_voltages(voltage_v, terminals, rail_v, dead_time_s, period_s);
  return pattern;
}

Times times_of(const SwitchingPattern& pattern, double period_s) {
  Times times;
  std::size_t segment = 0;
  for (double start_s = 0.0; start_s < period_s;) {
    segment = pattern.segment_at(start_s, segment);
    const double stop_s = std::min(period_s, pattern.end_s(segment));
    TerminalDrive out;
    pattern.put(segment, 3, 150.0, out);
    const Phases v = phase_array(out.start_v);
    for (std::size_t k = 0; k < 3; ++k) {
      if (out.mode[k] == TerminalMode::kDiodes) {
        times.dead_s[k] += stop_s - start_s;
      } else if (v[k] == 150.0) {
        times.high_s[k] += stop_s - start_s;
        if (times.first_high_s[k] < 0.0) times.first_high_s[k] = start_s;
        times.last_high_s[k] = stop_s;
      } else {
        EXPECT_EQ(v[k], -150.0);
      }
    }
    if (stop_s < period_s) ++times.edges;
    start_s = stop_s;
  }
  return times;
}

// Catches: edges lost or exchanged by the sorting, pulses off the middle, a dead time of the wrong length,
// terminals that are marked as another one.
TEST(Inverter, EveryPulseIsCentredAndHasItsLength) {
  std::mt19937_64 engine(7);
  std::uniform_real_distribution<double> voltage(-150.0, 150.0);
  constexpr double kPeriod_s = 100e-6;
  for (const double dead_s : {0.0, 2e-6}) {
    for (int n = 0; n < 500; ++n) {
      const ThreePhase wanted{voltage(engine), voltage(engine), n % 7 == 0 ? 150.0 : voltage(engine)};
      const Times times = times_of(pattern_of(wanted, 3, 150.0, dead_s, kPeriod_s), kPeriod_s);
      for (std::size_t k = 0; k < 3; ++k) {
        const double on = duty(phase_array(wanted)[k], 150.0, dead_s / kPeriod_s);
        const bool switches = on > 0.0 && on < 1.0;
        EXPECT_NEAR(times.high_s[k], on * kPeriod_s - (switches ? dead_s : 0.0), 1e-18);
        EXPECT_NEAR(times.dead_s[k], switches ? 2.0 * dead_s : 0.0, 1e-18);
        if (!switches) continue;
        EXPECT_NEAR(times.first_high_s[k] + times.last_high_s[k], kPeriod_s, 1e-18);
      }
    }
  }
}

// Catches: edges at one instant of which only one is taken.
TEST(Inverter, TerminalsSwitchTogetherAtEqualVoltages) {
  const Times times = times_of(pattern_of({30.0, 30.0, 30.0}, 3, 150.0, 0.0, 100e-6), 100e-6);
  for (const double high_s : times.high_s)
    EXPECT_NEAR(high_s, 60e-6, 1e-18);
  EXPECT_LE(times.edges, 6);
}

// Catches: a search that only goes forwards, or depends on where it starts.
TEST(Inverter, TheHintOfTheSearchChangesNothing) {
  const SwitchingPattern pattern = pattern_of({30.0, -60.0, 100.0}, 3, 150.0, 2e-6, 100e-6);
  for (double instant_s = 0.0; instant_s < 100e-6; instant_s += 0.37e-6) {
    for (std::size_t hint = 0; hint < 20; ++hint)
      EXPECT_EQ(pattern.segment_at(instant_s, hint), pattern.segment_at(instant_s, 0));
  }
}

/// Mean terminal voltages over the last ticks under a constant command, and the mean currents.
struct Means {
  Phases voltage_v{};
  Phases current_a{};
};

Means means(DriveKind kind, Connection connection, double dead_time_s, int pwm_periods,
            const Phases& command_v) {
  DriveParameters p = inverter(kind, dead_time_s);
  p.inverter.pwm_periods_per_tick = pwm_periods;
  DriveRig rig(p, connection, {.resistance_ohm = 5.0, .inductance_h = 20e-3}, 20);
  const PhaseCommand command = volts(command_v[0], command_v[1], command_v[2]);
  for (int tick = 0; tick < 800; ++tick)
    rig.tick(command);
  const DriveRig before = rig;
  constexpr int kTicks = 10;
  for (int tick = 0; tick < kTicks; ++tick)
    rig.tick(command);
  Means result;
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminal_count(connection)); ++k) {
    result.voltage_v[k] = (rig.volt_seconds[k] - before.volt_seconds[k]) / (kTicks * kRigTick_s);
    result.current_a[k] = (rig.charge_as[k] - before.charge_as[k]) / (kTicks * kRigTick_s);
  }
  return result;
}

// At a constant command the ripple has no mean: what is left of the difference are the last ones of 20 time
// constants. The mean of the switched terminal voltages must be that of the averaged ones with the dead-time
// error of -sign(i) 2 U_rail t_d/T_pwm; the currents (3 A and more) stay beyond their ripple of 0.4 A.
// Catches: a dead time with the wrong sign or half its effect, a lost edge, a rail of the wrong connection.
TEST(Inverter, TheSwitchedInverterAveragesToTheAveragedOne) {
  const Phases command_v{40.0, -55.0, 15.0};
  for (const Connection connection : {Connection::kStar, Connection::kIndependent, Connection::kTwoPhase}) {
    for (const double dead_time_s : {0.0, 0.5e-6}) {
      for (const int pwm_periods : {1, 3}) {
        const Means averaged = means(DriveKind::kAveraged, connection, dead_time_s, pwm_periods, command_v);
        const Means switched = means(DriveKind::kSwitched, connection, dead_time_s, pwm_periods, command_v);
        for (std::size_t k = 0; k < static_cast<std::size_t>(terminal_count(connection)); ++k) {
          EXPECT_NEAR(switched.voltage_v[k], averaged.voltage_v[k], 1e-9) << "terminal " << k;
          EXPECT_NEAR(switched.current_a[k], averaged.current_a[k], 2e-5) << "terminal " << k;
        }
        if (dead_time_s > 0.0 && connection == Connection::kTwoPhase) {
          const double error_v = 2.0 * kBus_v * dead_time_s * pwm_periods / kRigTick_s;
          EXPECT_NEAR(switched.voltage_v[0], 40.0 - error_v, 1e-9);
          EXPECT_NEAR(switched.voltage_v[1], -55.0 + error_v, 1e-9);
        }
      }
    }
  }
}

// Bipolar, duty D = 0.55: the current of a winding rises by (U - u) D T/L = 0.7425 A and falls again, about
// its mean of 6 A. The resistance bends the ramps by T R/L = 2.5 % at most. Catches: a ripple of another
// frequency or height, one that drifts, a switched voltage between 0 and one rail.
TEST(Inverter, TheRippleStaysWithinItsBound) {
  DriveRig rig(inverter(DriveKind::kSwitched), Connection::kArmature,
               {.resistance_ohm = 5.0, .inductance_h = 20e-3}, 50);
  for (int tick = 0; tick < 1500; ++tick)
    rig.tick(volts(30.0));
  rig.lowest_a = rig.highest_a = rig.current_a[0];
  for (int tick = 0; tick < 5; ++tick)
    rig.tick(volts(30.0));
  EXPECT_NEAR(rig.highest_a - rig.lowest_a, 0.7425, 0.01 * 0.7425);
  EXPECT_NEAR(0.5 * (rig.highest_a + rig.lowest_a), 6.0, 0.01);
}

// Catches: a zero-voltage command that switches, gates off that drive, edges beyond the tick.
TEST(Inverter, TheEdgesOfATickAreThoseOfItsPeriods) {
  DriveParameters p = inverter(DriveKind::kSwitched, 1e-6);
  p.inverter.pwm_periods_per_tick = 4;
  DriveRig rig(p, Connection::kStar);
  rig.drive.begin_tick(rig.memory, volts(50.0, -20.0, -30.0), {}, 0);
  std::set<double> edges;
  for (double t = rig.drive.next_edge_s(rig.memory, 0.0); t < 1.0; t = rig.drive.next_edge_s(rig.memory, t)) {
    EXPECT_TRUE(edges.insert(t).second);
    EXPECT_LT(t, kRigTick_s);
  }
  EXPECT_EQ(edges.size(), 4u * 12u + 3u);  // and the boundaries between the periods
  rig.drive.begin_tick(rig.memory, {.gates = Gates::kZeroVoltage}, {}, 1);
  TerminalDrive out = rig.drive.at(rig.memory, 50e-6, 1e-6, {});
  EXPECT_EQ(out.mode[1], TerminalMode::kDriven);
  EXPECT_EQ(out.start_v.b, 0.0);
  rig.drive.begin_tick(rig.memory, {}, {}, 2);
  out = rig.drive.at(rig.memory, 50e-6, 1e-6, {});
  for (const TerminalMode mode : out.mode)
    EXPECT_EQ(mode, TerminalMode::kDiodes);
  EXPECT_EQ(out.rail_v, 150.0);
}

// Catches: terminals that do not exist but are at a rail.
TEST(Inverter, TerminalsThatDoNotExistAreAtZero) {
  for (const DriveKind kind : {DriveKind::kAveraged, DriveKind::kSwitched}) {
    DriveRig rig(inverter(kind, 1e-6), Connection::kTwoPhase);
    rig.drive.begin_tick(rig.memory, volts(50.0, -20.0, 70.0), {}, 0);
    EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {.a = 1.0, .b = -1.0}).start_v.c, 0.0);
    EXPECT_EQ(rig.memory.saturated, 0.0);
  }
}

}  // namespace
}  // namespace drivebench::inverter_test
