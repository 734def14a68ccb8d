#include "plant/drive/supply/source.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tests/plant/drive_rig.hpp"

namespace drivebench::source_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kThird = 2.0 * kPi / 3.0;

DriveParameters source_drive(double amplitude_v, double frequency_hz) {
  DriveParameters p = plain_drive(DriveKind::kSource);
  p.source.amplitude_v = amplitude_v;
  p.source.frequency_hz = frequency_hz;
  return p;
}

ThreePhase at_angle(const SourceParameters& p, Connection connection, double angle_rad) {
  return source_voltages(p, constants_of(p, connection), 100.0, angle_rad);
}

// Catches: phases in the wrong order or at the wrong angle, a phase that a machine does not have.
TEST(Source, ThePhasesFollowEachOther) {
  const SourceParameters p;
  for (double angle = -4.0; angle < 4.0; angle += 0.3) {
    const ThreePhase star = at_angle(p, Connection::kStar, angle);
    EXPECT_NEAR(star.a, 100.0 * std::cos(angle), 1e-12);
    EXPECT_NEAR(star.b, 100.0 * std::cos(angle - kThird), 1e-12);
    EXPECT_NEAR(star.c, 100.0 * std::cos(angle - 2.0 * kThird), 1e-12);
    const ThreePhase two = at_angle(p, Connection::kTwoPhase, angle);
    EXPECT_NEAR(two.b, 100.0 * std::sin(angle), 1e-12);
    EXPECT_EQ(two.c, 0.0);
    EXPECT_EQ(at_angle(p, Connection::kArmature, angle).b, 0.0);
  }
}

// Catches: factors exchanged, an offset with the wrong sign, one that only sines have.
TEST(Source, AnUnbalancedSetHasItsFactorsAndOffsets) {
  SourceParameters p;
  p.amplitude_factor_b = 0.9;
  p.amplitude_factor_c = 1.2;
  p.phase_offset_b_rad = 0.1;
  p.phase_offset_c_rad = -0.2;
  ThreePhase v = at_angle(p, Connection::kStar, 0.7);
  EXPECT_NEAR(v.b, 90.0 * std::cos(0.7 - kThird + 0.1), 1e-12);
  EXPECT_NEAR(v.c, 120.0 * std::cos(0.7 - 2.0 * kThird - 0.2), 1e-12);
  p.waveform = Waveform::kTrapezoid;
  v = at_angle(p, Connection::kStar, 0.7);
  EXPECT_NEAR(v.b, 90.0 * trapezoid(0.7 - kThird + 0.1), 1e-12);
  EXPECT_NEAR(v.c, 120.0 * trapezoid(0.7 - 2.0 * kThird - 0.2), 1e-12);
}

// Tag BL-02: corners every 60 degrees, rms sqrt(7/9), fundamental 1.215854.
// Catches: a corner at another angle, a slope that misses the flat top, a half wave of the wrong sign.
TEST(Source, TheTrapezoidIsThatOfTheBrushlessMotor) {
  const auto degrees = [](double x) { return trapezoid(x * kPi / 180.0); };
  EXPECT_NEAR(degrees(0.0), 0.0, 1e-15);
  EXPECT_NEAR(degrees(15.0), 0.5, 1e-14);
  EXPECT_EQ(degrees(31.0), 1.0);
  EXPECT_EQ(degrees(149.0), 1.0);
  EXPECT_NEAR(degrees(165.0), 0.5, 1e-14);
  EXPECT_EQ(degrees(270.0), -1.0);
  EXPECT_NEAR(degrees(345.0 - 720.0), -0.5, 1e-14);
  double squares = 0.0;
  double fundamental = 0.0;
  constexpr int kPoints = 36'000;
  for (int n = 0; n < kPoints; ++n) {
    const double angle = (n + 0.5) * 2.0 * kPi / kPoints;
    squares += trapezoid(angle) * trapezoid(angle) / kPoints;
    fundamental += 2.0 * trapezoid(angle) * std::sin(angle) / kPoints;
  }
  EXPECT_NEAR(std::sqrt(squares), 0.881917, 1e-6);
  EXPECT_NEAR(fundamental, 1.215854, 1e-6);
}

// Catches: a table over the angle instead of the period, one that is not repeated, or not for negative
// angles.
TEST(Source, ATableIsReadOverThePeriod) {
  SourceParameters p;
  p.waveform = Waveform::kTable;
  p.table = Curve({{0.0, 0.0}, {0.25, 1.0}, {0.75, -1.0}, {1.0, 0.0}});
  for (const double turns : {0.0, 3.0, -2.0}) {
    EXPECT_NEAR(at_angle(p, Connection::kArmature, 2.0 * kPi * (turns + 0.125)).a, 50.0, 1e-11);
    EXPECT_NEAR(at_angle(p, Connection::kArmature, 2.0 * kPi * (turns + 0.5)).a, 0.0, 1e-11);
    EXPECT_NEAR(at_angle(p, Connection::kStar, 2.0 * kPi * (turns + 0.25) + kThird).b, 100.0, 1e-11);
  }
}

using Points = std::vector<std::array<double, 2>>;

/// Integral from part 0 of a period to part x of the line through these points, which repeats.
double integral(const Points& points, double x) {
  const auto within = [&points](double to) {
    double sum = 0.0;
    for (std::size_t k = 0; k + 1 < points.size() && points[k][0] < to; ++k) {
      const auto [x0, y0] = points[k];
      const auto [x1, y1] = points[k + 1];
      const double end = std::min(to, x1);
      if (x1 > x0) sum += (end - x0) * (y0 + 0.5 * (end - x0) * (y1 - y0) / (x1 - x0));
    }
    return sum;
  };
  const double whole = std::floor(x);
  return whole * within(1.0) + within(x - whole);
}

/// The largest difference of the voltage-time areas of a source of 100 V from those of the waveform, after 10
/// to 390 ticks.
double largest_area_error(DriveParameters p, const Points& waveform, double frequency_hz) {
  p.source.amplitude_v = 100.0;
  p.source.frequency_hz = frequency_hz;
  p.source.phase_rad = 0.3;
  DriveRig rig(p, Connection::kStar);
  double largest = 0.0;
  for (int tick = 1; tick < 400; ++tick) {
    rig.tick({});
    for (std::size_t k = 0; k < 3; ++k) {
      const double from = 0.3 / (2.0 * kPi) - static_cast<double>(k) / 3.0;
      const double to = from + frequency_hz * tick * kRigTick_s;
      const double area = 100.0 / frequency_hz * (integral(waveform, to) - integral(waveform, from));
      largest = std::max(largest, std::abs(rig.volt_seconds[k] - area));
    }
  }
  return largest;
}

const Points kTrapezoidPoints{{0.0, 0.0},       {1.0 / 12, 1.0},   {5.0 / 12, 1.0},
                              {7.0 / 12, -1.0}, {11.0 / 12, -1.0}, {1.0, 0.0}};

// Between corners a piecewise linear voltage has the area that Simpson's rule gives: what is left is rounding
// of 1e-15 in 400 ticks. Across a corner the area is off by up to 2.5e-7 V s. Catches: a corner that is no
// edge, or at the wrong place for a phase or a direction.
TEST(Source, PiecesEndAtTheCornersOfTheWaveform) {
  DriveParameters p = plain_drive(DriveKind::kSource);
  p.source.waveform = Waveform::kTrapezoid;
  for (const double frequency : {50.0, -50.0, 333.0})
    EXPECT_LT(largest_area_error(p, kTrapezoidPoints, frequency), 1e-12) << frequency;
  p.source.waveform = Waveform::kTable;
  p.source.table = Curve({{0.0, 0.0}, {0.1, 1.0}, {0.45, 0.2}, {0.7, -1.0}, {1.0, 0.0}});
  const Points table{{0.0, 0.0}, {0.1, 1.0}, {0.45, 0.2}, {0.7, -1.0}, {1.0, 0.0}};
  for (const double frequency : {50.0, -50.0, 333.0})
    EXPECT_LT(largest_area_error(p, table, frequency), 1e-12) << frequency;
}

// A table that starts later than 0, ends before 1, and has different values there jumps at the end of the
// period. An instant is known to 1e-13 s, and so is the area of a jump of 100 V to 1e-11. Catches: a jump
// that lies within a piece, or whose two sides are mixed up at the ends of the pieces.
TEST(Source, PiecesEndAtTheJumpOfATable) {
  DriveParameters p = plain_drive(DriveKind::kSource);
  p.source.waveform = Waveform::kTable;
  p.source.table = Curve({{0.2, -1.0}, {0.9, 1.0}});
  const Points saw{{0.0, -1.0}, {0.2, -1.0}, {0.9, 1.0}, {1.0, 1.0}};
  for (const double frequency : {50.0, -50.0})
    EXPECT_LT(largest_area_error(p, saw, frequency), 1e-9) << frequency;
}

// Catches: a tick with more pieces than it can record.
TEST(Source, AFineTableOrAFastWaveformHasNoCorners) {
  SourceParameters p;
  p.waveform = Waveform::kTable;
  p.frequency_hz = 50.0;
  std::vector<CurvePoint> points;
  for (int n = 0; n <= 64; ++n)
    points.push_back({n / 64.0, n % 2 == 0 ? 1.0 : -1.0});
  p.table = Curve(points);
  EXPECT_FALSE(has_corners(p, kRigTick_s));
  points.pop_back();
  p.table = Curve(points);
  EXPECT_TRUE(has_corners(p, kRigTick_s));
  p.frequency_hz = -10'001.0;
  EXPECT_FALSE(has_corners(p, kRigTick_s));
  p.frequency_hz = 0.0;
  EXPECT_FALSE(has_corners(p, kRigTick_s));
  p.frequency_hz = 50.0;
  p.waveform = Waveform::kSine;
  EXPECT_FALSE(has_corners(p, kRigTick_s));
}

// Catches: values of the wrong instant of an interval, a phase that starts anew at each tick.
TEST(Source, TheValuesOfAnIntervalAreExact) {
  DriveParameters p = source_drive(100.0, 50.0);
  p.source.phase_rad = 0.4;
  DriveRig rig(p, Connection::kStar);
  for (int tick = 0; tick < 1000; ++tick)
    rig.tick({});
  rig.drive.begin_tick(rig.memory, {}, {}, rig.now);
  const TerminalDrive out = rig.drive.at(rig.memory, 30e-6, 8e-6, {});
  EXPECT_FALSE(out.constant);
  const double start_rad = 0.4 + 2.0 * kPi * 50.0 * (1000 * kRigTick_s + 30e-6);
  EXPECT_NEAR(out.start_v.a, 100.0 * std::cos(start_rad), 1e-10);
  EXPECT_NEAR(out.middle_v.b, 100.0 * std::cos(start_rad + 2.0 * kPi * 50.0 * 4e-6 - kThird), 1e-10);
  EXPECT_NEAR(out.end_v.c, 100.0 * std::cos(start_rad + 2.0 * kPi * 50.0 * 8e-6 + kThird), 1e-10);
}

// Catches: a frequency step that moves the phase, an amplitude or phase step that waits, phase_rad counted
// twice.
TEST(Source, StepsActFromTheNextTickWithAContinuousPhase) {
  DriveParameters p = source_drive(100.0, 50.0);
  DriveRig rig(p, Connection::kArmature);
  const auto start_v = [&rig] {
    rig.drive.begin_tick(rig.memory, {}, {}, rig.now);
    return rig.drive.at(rig.memory, 0.0, 1e-5, {}).start_v.a;
  };
  for (int tick = 0; tick < 37; ++tick)
    rig.tick({});
  double phase = 2.0 * kPi * 50.0 * 37 * kRigTick_s;
  p.source.frequency_hz = 400.0;
  rig.drive.set_parameters(p);
  EXPECT_NEAR(start_v(), 100.0 * std::cos(phase), 1e-10);
  phase += 2.0 * kPi * 400.0 * kRigTick_s;
  EXPECT_NEAR(start_v(), 100.0 * std::cos(phase), 1e-10);
  phase += 2.0 * kPi * 400.0 * kRigTick_s;
  p.source.amplitude_v = 60.0;
  p.source.phase_rad = 1.0;
  rig.drive.set_parameters(p);
  EXPECT_NEAR(start_v(), 60.0 * std::cos(phase + 1.0), 1e-10);
}

// Catches: a DC source that turns, or is taken as varying.
TEST(Source, AtFrequencyZeroItIsDirectCurrent) {
  DriveRig rig(source_drive(24.0, 0.0), Connection::kArmature, {.resistance_ohm = 8.0, .inductance_h = 1e-3});
  for (int tick = 0; tick < 100; ++tick)
    rig.tick({});
  const TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-5, {});
  EXPECT_TRUE(out.constant);
  EXPECT_EQ(out.start_v.a, 24.0);
  EXPECT_NEAR(rig.current_a[0], 3.0, 1e-9);
}

/// Seconds from the start at which the contactor of a 50 Hz source, told to close at tick 3, has closed.
double closing_instant_s(double angle_rad, double frequency_hz) {
  DriveParameters p = source_drive(100.0, frequency_hz);
  p.source.contactor = false;
  DriveRig rig(p, Connection::kStar);
  for (int tick = 0; tick < 3; ++tick)
    rig.tick({});
  p.source.contactor = true;
  p.source.choose_angle = true;
  p.source.closing_angle_rad = angle_rad;
  rig.drive.set_parameters(p);
  for (int tick = 3; tick < 1000; ++tick) {
    rig.drive.begin_tick(rig.memory, {}, {}, tick);
    const double edge_s = rig.drive.next_edge_s(rig.memory, 0.0);
    const bool open = rig.drive.at(rig.memory, 0.0, 1e-9, {}).mode[0] == TerminalMode::kOpen;
    if (!open) return tick * kRigTick_s;
    if (edge_s < kRigTick_s) {
      EXPECT_EQ(rig.drive.at(rig.memory, 0.5 * edge_s, 1e-9, {}).mode[2], TerminalMode::kOpen);
      EXPECT_EQ(rig.drive.at(rig.memory, edge_s, 1e-9, {}).mode[2], TerminalMode::kDriven);
      EXPECT_EQ(rig.drive.next_edge_s(rig.memory, edge_s), std::numeric_limits<double>::infinity());
      return tick * kRigTick_s + edge_s;
    }
  }
  return -1.0;
}

// Catches: a contactor that closes at the tick, at the angle of another phase, or one turn late.
TEST(Source, TheContactorClosesAtItsAngle) {
  const double omega = 2.0 * kPi * 50.0;
  for (const double angle : {0.2, 0.5 * kPi, 3.0, 5.5}) {
    EXPECT_NEAR(closing_instant_s(angle, 50.0), angle / omega, 1e-15) << angle;
    EXPECT_NEAR(closing_instant_s(angle, -50.0), (2.0 * kPi - angle) / omega, 1e-15) << angle;
  }
  EXPECT_NEAR(closing_instant_s(0.05, 50.0), (2.0 * kPi + 0.05) / omega, 1e-15);  // passed before tick 3
  // Exactly at a tick, before or after rounding.
  EXPECT_NEAR(closing_instant_s(omega * 40 * kRigTick_s, 50.0), 40 * kRigTick_s, 1e-15);
}

// Catches: a contactor that stays, one that a trip cannot open, one that does not close again.
TEST(Source, AnOpenContactorLeavesTheTerminalsOpen) {
  DriveParameters p = source_drive(100.0, 50.0);
  DriveRig rig(p, Connection::kStar);
  rig.tick({});
  EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).mode[1], TerminalMode::kDriven);
  rig.drive.switch_off(rig.memory);
  const TerminalDrive tripped = rig.drive.at(rig.memory, 50e-6, 1e-6, {});
  EXPECT_EQ(tripped.mode[1], TerminalMode::kOpen);
  EXPECT_GE(tripped.rail_v, 200.0);  // the arc is stronger than the source
  rig.tick({});
  EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).mode[1], TerminalMode::kDriven);
  p.source.contactor = false;
  rig.drive.set_parameters(p);
  rig.tick({});
  EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).mode[1], TerminalMode::kOpen);
  EXPECT_EQ(DriveRig(p, Connection::kStar).memory.contactor_closed, 0.0);
}

// Catches: a source that obeys gates or voltages, one that a sag does not reach.
TEST(Source, CommandsDoNothingAndASagLowersTheAmplitude) {
  DriveRig rig(source_drive(100.0, 50.0), Connection::kStar);
  InjectedFaults faults;
  faults.bus_sag = 0.3;
  faults.leg_stuck_high = 1.0;
  rig.drive.begin_tick(rig.memory, volts(5.0), {}, 0);
  EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).start_v.a, 100.0);
  rig.memory = rig.drive.initial();
  rig.drive.begin_tick(rig.memory, {}, faults, 0);
  EXPECT_NEAR(rig.drive.at(rig.memory, 0.0, 1e-6, {}).start_v.a, 70.0, 1e-12);
  EXPECT_EQ(rig.memory.bus_v, 0.0);
}

/// The winding of phase b of the single-phase motor IM-C with its start capacitor (tag P3-12), as a series
/// circuit on a 50 Hz source that closes at a zero of the voltage.
constexpr double kStartCapacitance_f = 44.8e-6;
constexpr double kStartResistance_ohm = 56.3;
constexpr RigLoad kStartLoad{.resistance_ohm = 2.9, .inductance_h = 17.5e-3};

DriveRig started(int substeps) {
  DriveParameters p = source_drive(170.0, 50.0);
  p.source.start_capacitance_f = kStartCapacitance_f;
  p.source.start_resistance_ohm = kStartResistance_ohm;
  p.source.phase_rad = -0.5 * kPi;
  DriveRig rig(p, Connection::kTwoPhase, kStartLoad, substeps);
  for (int tick = 0; tick < 200; ++tick)
    rig.tick({});
  return rig;
}

// Catches: a capacitor that misses current, has the wrong sign, or charges while nothing flows.
TEST(Source, TheStartCapacitorHoldsTheChargeThatHasPassed) {
  for (const int substeps : {10, 40}) {
    const DriveRig rig = started(substeps);
    // The rig counts charge by trapezoids, the drive by parabolas: they differ by the ends of h^2/12 di/dt.
    const double h = kRigTick_s / substeps;
    EXPECT_NEAR(rig.memory.start_capacitor.voltage_v * kStartCapacitance_f, rig.charge_as[1],
                h * h / 12.0 * 3000.0);
    EXPECT_GT(std::abs(rig.memory.start_capacitor.voltage_v), 1.0);
  }
}

// Against half the substep the error must fall by about eight: a quarter or more better than second order.
// Catches: a current or a charge that is held over the interval, or continued by a line only.
TEST(Source, TheStartCapacitorIsThirdOrderAccurate) {
  const double reference_v = started(160).memory.start_capacitor.voltage_v;
  const double reference_a = started(160).current_a[1];
  const DriveRig coarse = started(5);
  const DriveRig fine = started(10);
  EXPECT_LT(std::abs(coarse.memory.start_capacitor.voltage_v - reference_v), 1e-4);
  EXPECT_GT(std::abs(coarse.memory.start_capacitor.voltage_v - reference_v),
            6.0 * std::abs(fine.memory.start_capacitor.voltage_v - reference_v));
  EXPECT_GT(std::abs(coarse.current_a[1] - reference_a), 6.0 * std::abs(fine.current_a[1] - reference_a));
}

// In the steady state the current is that of the impedance R + R_b + j(w L - 1/(w C)).
// Catches: a resistance left out, a capacitor fed from the wrong phase.
TEST(Source, TheStartCapacitorIsInSeriesWithPhaseA) {
  DriveRig rig = started(10);
  double highest_a = 0.0;
  for (int tick = 0; tick < 2000; ++tick) {
    rig.tick({});
    if (tick >= 1800) highest_a = std::max(highest_a, std::abs(rig.current_a[1]));
  }
  const double omega = 2.0 * kPi * 50.0;
  const double reactance_ohm = omega * 17.5e-3 - 1.0 / (omega * kStartCapacitance_f);
  EXPECT_NEAR(highest_a, 170.0 / std::hypot(2.9 + kStartResistance_ohm, reactance_ohm), 1e-3);
}

// An event of the machine may leave an interval of rounding size. Catches: a slope taken from such an
// interval.
TEST(Source, AnIntervalOfNoLengthLeavesTheSlopeOfTheCurrent) {
  SourceParameters p;
  p.start_capacitance_f = kStartCapacitance_f;
  const StartCapacitor before{.voltage_v = 3.0,
                              .current = {.slope_a_s = 100.0, .bend_a_s2 = 5.0, .interval_s = 10e-6}};
  const StartCapacitor after = charged(p, before, 1.0, 1.0 + 1e-15, 1e-17);
  EXPECT_EQ(after.current.slope_a_s, 100.0);
  EXPECT_EQ(after.current.bend_a_s2, 5.0);
  EXPECT_NEAR(after.voltage_v, 3.0, 1e-12);
}

// Catches: a switch that leaves the capacitor in, one that loses its charge.
TEST(Source, TheStartSwitchShortsPhaseB) {
  DriveRig rig = started(10);
  DriveParameters p = source_drive(170.0, 50.0);
  p.source.start_capacitance_f = kStartCapacitance_f;
  p.source.start_resistance_ohm = kStartResistance_ohm;
  p.source.start_switch = true;
  const double held_v = rig.memory.start_capacitor.voltage_v;
  rig.drive.set_parameters(p);
  rig.tick({});
  const TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-5, {.a = 1.0, .b = 1.0});
  EXPECT_EQ(out.start_v.b, 0.0);
  EXPECT_EQ(out.middle_v.b, 0.0);
  EXPECT_EQ(out.end_v.b, 0.0);
  EXPECT_NE(out.start_v.a, 0.0);
  EXPECT_EQ(rig.memory.start_capacitor.voltage_v, held_v);
}

}  // namespace
}  // namespace drivebench::source_test
