#include <gtest/gtest.h>

#include <cmath>

#include "plant/axis.hpp"
#include "plant/math/rk4.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::shared_amplifier_test {
namespace {

constexpr AxisTiming kTiming{.period_s = 1e-4, .substeps = 4};
constexpr PhaseCommand kOff{.gates = Gates::kOff};

constexpr PhaseCommand volts(double a, double b = 0.0) {
  return {.gates = Gates::kVoltage, .setpoint = {.a = a, .b = b}};
}

/// The DC motor DC-A of the book.
AxisParameters dc_axis(double inertia_kgm2 = 6e-5) {
  AxisParameters p;
  p.machine = PmDcMachineParameters{
      .armature_resistance_ohm = 2.0, .armature_inductance_h = 2e-3, .torque_constant_nm_per_a = 0.07};
  p.mechanics = {.inertia_kgm2 = inertia_kgm2, .viscous_friction_nms = 4e-4};
  p.drive.amplifier = {.voltage_limit_v = 100.0, .over_current_a = 100.0};
  return p;
}

Axis dc_motor(const AxisParameters& p, std::uint64_t number, double current_a = 0.0,
              double speed_rad_s = 0.0) {
  Axis axis(p, kTiming, 1, number);
  AxisState state = axis.state();
  state.machine[0] = current_a;
  state.shaft.speed_rad_s = speed_rad_s;
  state.open_terminals = 0;
  axis.restore(state);
  return axis;
}

// Both are the same Runge-Kutta method on the same equations. Catches: a second machine that gets no voltage,
// half of it, or the load of the first; a piece that is run twice.
TEST(SharedAmplifier, DrivesEachMachineAsIfItWereAlone) {
  Axis first = dc_motor(dc_axis(), 0);
  Axis second = dc_motor(dc_axis(1.2e-4), 1);
  Axis alone = dc_motor(dc_axis(), 0);
  Axis heavy_alone = dc_motor(dc_axis(1.2e-4), 1);
  second.set_load(0.02, 0, 0);
  heavy_alone.set_load(0.02, 0, 0);
  for (Tick tick = 0; tick < 2000; ++tick) {
    const PhaseCommand command = volts(tick < 1000 ? 20.0 : -15.0);
    Axis::advance_on_one_amplifier(first, second, command, tick);
    alone.advance(command, tick);
    heavy_alone.advance(command, tick);
    ASSERT_NEAR(first.sample(tick + 1).true_i_a_a, alone.sample(tick + 1).true_i_a_a, 1e-12);
    ASSERT_NEAR(second.sample(tick + 1).true_i_a_a, heavy_alone.sample(tick + 1).true_i_a_a, 1e-12);
  }
  EXPECT_NEAR(first.sample(2000).speed_rad_s, alone.sample(2000).speed_rad_s, 1e-10);
  EXPECT_NEAR(second.sample(2000).angle_rad, heavy_alone.sample(2000).angle_rad, 1e-10);
  EXPECT_EQ(second.sample(2000).encoder_count, heavy_alone.sample(2000).encoder_count);
  EXPECT_EQ(second.sample(2000).u_a_v, -15.0);
  EXPECT_EQ(first.sample(2000).u_a_v, -15.0);
}

// Each has 4 A, the limit is 6 A. Catches: a trip by the current of one machine, a trip that leaves the other
// axis without the latch, a machine that goes on being driven.
TEST(SharedAmplifier, TripsByTheSumOfTheCurrents) {
  AxisParameters p = dc_axis();
  p.drive.amplifier.over_current_a = 6.0;
  p.mechanics.motion = ShaftMotion::kImposed;
  Axis first = dc_motor(p, 0);
  Axis second = dc_motor(p, 1);
  Axis alone = dc_motor(p, 0);
  std::uint64_t seen = 0;
  for (Tick tick = 0; tick < 100; ++tick) {
    Axis::advance_on_one_amplifier(first, second, volts(8.0), tick);
    alone.advance(volts(8.0), tick);
    seen |= second.sample(tick + 1).faults;
  }
  EXPECT_NE(seen & kOverCurrent, 0u) << "the bit of the tick, too";
  EXPECT_EQ(alone.sample(100).faults & kOverCurrentTrip, 0u);
  EXPECT_NE(first.sample(100).faults & kOverCurrentTrip, 0u);
  EXPECT_NE(second.sample(100).faults & kOverCurrentTrip, 0u);
  EXPECT_NEAR(first.sample(100).true_i_a_a, 0.0, 1e-9);
  EXPECT_NEAR(second.sample(100).true_i_a_a, 0.0, 1e-9);
}

// Two equal machines on a link of 2 C behind R/2 are one on C behind R, twice. Catches: a link that feels one
// of them, or each alone.
TEST(SharedAmplifier, TakesThePowerOfBothFromItsLink) {
  AxisParameters one = dc_axis();
  one.drive.kind = DriveKind::kAveraged;
  one.drive.bus = {.voltage_v = 60.0, .resistance_ohm = 2.0, .capacitance_f = 1e-4};
  AxisParameters both = one;
  both.drive.bus.resistance_ohm = 1.0;
  both.drive.bus.capacitance_f = 2e-4;
  Axis first = dc_motor(both, 0);
  Axis second = dc_motor(both, 1);
  Axis alone = dc_motor(one, 0);
  double least_v = 60.0;
  for (Tick tick = 0; tick < 1000; ++tick) {
    const PhaseCommand command = tick < 500 ? volts(40.0) : kOff;
    Axis::advance_on_one_amplifier(first, second, command, tick);
    alone.advance(command, tick);
    ASSERT_NEAR(first.sample(tick + 1).bus_voltage_v, alone.sample(tick + 1).bus_voltage_v, 1e-9) << tick;
    ASSERT_EQ(first.sample(tick + 1).bus_voltage_v, second.sample(tick + 1).bus_voltage_v);
    ASSERT_NEAR(second.sample(tick + 1).true_i_a_a, alone.sample(tick + 1).true_i_a_a, 1e-9) << tick;
    least_v = std::min(least_v, first.sample(tick + 1).bus_voltage_v);
  }
  EXPECT_LT(least_v, 50.0);
}

/// Two motors in a loop of their own: the current from one into the other, and both speeds.
struct Loop {
  double i;
  double w1;
  double w2;
};

Loop loop_step(const Loop& x, double h) {
  return rk4_step(x, h, [](const Loop& s) -> Loop {
    return {(-4.0 * s.i - 0.07 * (s.w1 - s.w2)) / 4e-3, (0.07 * s.i - 4e-4 * s.w1) / 6e-5,
            (-0.07 * s.i - 4e-4 * s.w2) / 1.2e-4};
  });
}

// With the gates off the emfs drive a current around both windings, against the closed loop written out. The
// terminals have a constant voltage in each step of 25 us: 1e-4. Catches: machines on diodes of their own,
// which keep 50 and 0 rad/s; a sum of currents that is not 0.
TEST(SharedAmplifier, WithItsGatesOffTheMachinesBrakeEachOther) {
  Axis first = dc_motor(dc_axis(), 0, 0.0, 50.0);
  Axis second = dc_motor(dc_axis(1.2e-4), 1);
  Loop x{.i = 0.0, .w1 = 50.0, .w2 = 0.0};
  for (Tick tick = 0; tick < 500; ++tick) {
    Axis::advance_on_one_amplifier(first, second, kOff, tick);
    for (int n = 0; n < 100; ++n)
      x = loop_step(x, 1e-6);
    const Sample a = first.sample(tick + 1);
    const Sample b = second.sample(tick + 1);
    ASSERT_NEAR(a.true_i_a_a + b.true_i_a_a, 0.0, 1e-9);
    ASSERT_NEAR(a.true_i_a_a, x.i, 1e-4);
    ASSERT_NEAR(a.speed_rad_s, x.w1, 5e-3);
    ASSERT_NEAR(b.speed_rad_s, x.w2, 5e-3);
    ASSERT_EQ(a.u_a_v, b.u_a_v);
  }
  EXPECT_GT(second.sample(500).speed_rad_s, 10.0);
}

// 3 A into one and 1 A out of the other: the diode conducts the 2 A until they are gone, while both windings
// have the rail, and then the terminal floats. Both shafts stand. Catches: a rail chosen by one machine's
// current, a diode that conducts in reverse, a sum that dies at the end of a step.
TEST(SharedAmplifier, AfterADrivenTickADiodeTakesTheSumOfTheCurrents) {
  AxisParameters p = dc_axis();
  p.mechanics.motion = ShaftMotion::kImposed;
  Axis first = dc_motor(p, 0, 3.0);
  Axis second = dc_motor(p, 1, -1.0);
  Axis::advance_on_one_amplifier(first, second, kOff, 0);
  // Both follow i' = (-100 - 2 i)/2e-3, and their sum is 0 after t: i1 + i2 = (102) e^(-1000 t) - 100.
  const double sum_dies_s = 1e-3 * std::log(102.0 / 100.0);
  ASSERT_LT(sum_dies_s, 1e-4);
  const double difference_a = 4.0 * std::exp(-1e-4 / 1e-3);
  const Sample a = first.sample(1);
  const Sample b = second.sample(1);
  EXPECT_NEAR(a.true_i_a_a + b.true_i_a_a, 0.0, 1e-9);
  EXPECT_NEAR(a.true_i_a_a - b.true_i_a_a, difference_a, 1e-6) << "the difference dies in the loop of both";
  EXPECT_NEAR(a.u_a_v, 0.0, 1e-6) << "equal machines at rest: the terminal floats at 0";
}

// The emfs of 7 V and 14 V are beyond a rail of 5 V. Catches: a floating terminal that passes the diodes.
TEST(SharedAmplifier, AFloatingTerminalIsHeldByItsDiodes) {
  AxisParameters p = dc_axis();
  p.drive.amplifier.voltage_limit_v = 5.0;
  p.mechanics.motion = ShaftMotion::kImposed;
  p.mechanics.imposed_speed_rad_s = 100.0;
  AxisParameters q = p;
  q.mechanics.imposed_speed_rad_s = 200.0;
  Axis first = dc_motor(p, 0, 0.0, 100.0);
  Axis second = dc_motor(q, 1, 0.0, 200.0);
  for (Tick tick = 0; tick < 200; ++tick)
    Axis::advance_on_one_amplifier(first, second, kOff, tick);
  EXPECT_NEAR(first.sample(200).u_a_v, 5.0, 1e-9);
  EXPECT_NEAR(first.sample(200).true_i_a_a, (5.0 - 7.0) / 2.0, 1e-6);
  EXPECT_NEAR(second.sample(200).true_i_a_a, (5.0 - 14.0) / 2.0, 1e-6);
}

// Catches: a broken wire of one machine that opens the other, too; one of the second that is not its own.
TEST(SharedAmplifier, ABrokenWireIsThatOfOneMachine) {
  const std::size_t row = find_injectable_fault("open_phase");
  for (const bool is_first : {true, false}) {
    Axis first = dc_motor(dc_axis(), 0);
    Axis second = dc_motor(dc_axis(), 1);
    (is_first ? first : second).inject(row, 1.0);
    for (Tick tick = 0; tick < 50; ++tick)
      Axis::advance_on_one_amplifier(first, second, volts(10.0), tick);
    EXPECT_EQ(first.sample(50).true_i_a_a == 0.0, is_first);
    EXPECT_EQ(second.sample(50).true_i_a_a == 0.0, !is_first);
  }
}

/// Induction motors in stars, three phases, the second one turned by hand.
AxisParameters star_axis() {
  AxisParameters p = servo_axis();
  std::get<InductionMachineParameters>(p.machine).star = true;
  return p;
}

// Fluxed and turning. Catches: a star whose sums do not vanish, terminals that drift away from the middle of
// the link.
TEST(SharedAmplifier, StarsFloatWithoutASumOfCurrents) {
  AxisParameters p = star_axis();
  p.drive.amplifier.voltage_limit_v = 200.0;
  Axis first(p, kServoTiming, 1, 0);
  Axis second(p, kServoTiming, 1, 1);
  AxisState state = first.state();
  set_induction_state(state, {.i_a_a = 3.0, .i_b_a = -1.5, .psi_a_wb = 0.04, .psi_b_wb = -0.02});
  state.shaft.speed_rad_s = 100.0;
  first.restore(state);
  for (Tick tick = 0; tick < 100; ++tick)
    Axis::advance_on_one_amplifier(first, second, kOff, tick);
  const Sample a = first.sample(100);
  const Sample b = second.sample(100);
  EXPECT_NEAR(a.true_i_a_a + b.true_i_a_a, 0.0, 1e-9);
  EXPECT_NEAR(a.true_i_b_a + b.true_i_b_a, 0.0, 1e-9);
  EXPECT_NEAR(a.true_i_c_a + b.true_i_c_a, 0.0, 1e-9);
  EXPECT_GT(std::abs(a.true_i_a_a) + std::abs(a.true_i_b_a), 0.01) << "the flux of one drives both";
  EXPECT_NEAR(a.u_a_v + a.u_b_v + a.u_c_v, 0.0, 1e-9);
  EXPECT_EQ(a.faults, 0u);
}

// Catches: an axis that goes on alone after its partner has diverged.
TEST(SharedAmplifier, BothHoldWhereOneDiverges) {
  Axis first = dc_motor(dc_axis(), 0);
  Axis second = dc_motor(dc_axis(), 1, 1e300, 1e300);
  Axis::advance_on_one_amplifier(first, second, volts(1.0), 0);
  EXPECT_NE(first.sample(1).faults & kDiverged, 0u);
  EXPECT_NE(second.sample(1).faults & kDiverged, 0u);
}

}  // namespace
}  // namespace drivebench::shared_amplifier_test
