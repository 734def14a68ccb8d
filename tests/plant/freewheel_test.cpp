#include "plant/axis.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/plant/servo_axis.hpp"

namespace drivebench::freewheel_test {
namespace {

constexpr PhaseCommand volts(double a, double b) {
  return {.gates = Gates::kVoltage, .setpoint = {a, b}};
}
constexpr PhaseCommand kOff{.gates = Gates::kOff};
constexpr InductionMachineState kFluxed{.i_a_a = 6.0, .i_b_a = -3.5, .psi_a_wb = 0.04, .psi_b_wb = -0.02};

Axis axis_with_link(double link_v, InductionMachineState machine = {}, double speed_rad_s = 0.0) {
  AxisParameters p = servo_axis();
  p.drive.amplifier.voltage_limit_v = link_v;
  Axis axis(p, kServoTiming, 1, 0);
  AxisState state = axis.state();
  set_induction_state(state, machine);
  state.shaft.speed_rad_s = speed_rad_s;
  axis.restore(state);
  return axis;
}

// Catches: a saturation flag that sticks, or is set by the wrong phase's limit.
TEST(Freewheel, TheSaturationFlagLastsAsLongAsTheClipping) {
  Axis axis = axis_with_link(20.0);
  axis.advance(volts(0.0, 25.0), 0);
  EXPECT_EQ(axis.sample(1).faults, kVoltageSaturated);
  EXPECT_EQ(axis.sample(1).u_b_v, 20.0);
  axis.advance(volts(0.0, 15.0), 1);
  EXPECT_EQ(axis.sample(2).faults, 0u);
  EXPECT_EQ(axis.sample(2).u_b_v, 15.0);
}

// The current rises by 25 us V/(sigma L_S) = 0.59 A per substep of 100 V, so that 1 A is exceeded at the
// second of five. Masked, it is a flag and clips nothing; unmasked, the diodes empty the phase within the
// same tick. Catches: a trip that waits for the next tick, a limit that clips, a flag that latches.
TEST(Freewheel, OverCurrentIsAFlagAndUnmaskedTripsWithinTheTick) {
  for (const bool trips : {false, true}) {
    for (const double sign : {1.0, -1.0}) {
      AxisParameters p = servo_axis();
      p.drive.amplifier = {.voltage_limit_v = 100.0, .over_current_a = 1.0, .over_current_trip = trips};
      Axis axis(p, kServoTiming, 1, 0);
      axis.advance(volts(0.0, sign * 100.0), 0);
      const Sample s = axis.sample(1);
      EXPECT_EQ(s.faults, trips ? kOverCurrent | kOverCurrentTrip : kOverCurrent);
      if (trips) {
        EXPECT_EQ(s.true_i_b_a, 0.0);
      } else {
        EXPECT_GT(sign * s.true_i_b_a, 2.5);
        EXPECT_EQ(s.u_b_v, sign * 100.0);
      }
      axis.advance(volts(0.0, trips ? sign * 100.0 : -sign * 100.0), 1);
      EXPECT_EQ(axis.sample(2).faults & kOverCurrentTrip, trips ? kOverCurrentTrip : 0u);
      if (trips) {
        EXPECT_EQ(axis.sample(2).faults, kOverCurrentTrip);  // the current is gone, the latch is not
        EXPECT_EQ(axis.sample(2).true_i_b_a, 0.0);
        axis.clear_faults();
        axis.advance(volts(0.0, sign * 10.0), 2);
        EXPECT_EQ(axis.sample(3).faults, 0u);
        EXPECT_GT(sign * axis.sample(3).true_i_b_a, 0.2);
      }
    }
  }
}

// Catches: a trip that looks at phase a only, or at the signed current.
TEST(Freewheel, ExactlyTheLimitIsNotAnOverCurrent) {
  AxisParameters p = servo_axis();
  p.drive.amplifier = {.voltage_limit_v = 100.0, .over_current_a = 1.0};
  Axis axis(p, kServoTiming, 1, 0);
  axis.advance(volts(20.0, -20.0), 0);
  const double reached_a = std::abs(axis.sample(1).true_i_b_a);
  for (const double limit_a : {reached_a, std::nextafter(reached_a, 0.0)}) {
    p.drive.amplifier.over_current_a = limit_a;
    Axis again(p, kServoTiming, 1, 0);
    again.advance(volts(20.0, -20.0), 0);
    EXPECT_EQ(again.sample(1).faults, limit_a == reached_a ? 0u : kOverCurrent | kOverCurrentTrip);
  }
}

// Catches: currents that ring around zero, pass it, or leave a remainder; a phase that closes again.
TEST(Freewheel, FreewheelingCurrentsDecayToExactlyZeroAndStayThere) {
  Axis axis = axis_with_link(40.0, kFluxed);
  double last_a = 6.0;
  double last_b = -3.5;
  for (Tick tick = 0; tick < 400; ++tick) {
    axis.advance(kOff, tick);
    const Sample s = axis.sample(tick + 1);
    EXPECT_TRUE(s.true_i_a_a >= 0.0 && s.true_i_a_a <= last_a);
    EXPECT_TRUE(s.true_i_b_a <= 0.0 && s.true_i_b_a >= last_b);
    last_a = s.true_i_a_a;
    last_b = s.true_i_b_a;
    if (tick == 0) {
      EXPECT_EQ(s.u_a_v, -40.0);  // against the current
      EXPECT_EQ(s.u_b_v, 40.0);
    }
  }
  EXPECT_EQ(last_a, 0.0);
  EXPECT_EQ(last_b, 0.0);
}

/// Energy that flows out of the terminals while the gates are off, until the currents are zero.
struct Freewheel {
  double into_link_j = 0.0;
  double lost_j = 0.0;
  double delivered_j = 0.0;
  double stored_before_j = 0.0;
  double stored_after_j = 0.0;
};

Freewheel freewheel(double link_v) {
  AxisParameters p = servo_axis();
  p.drive.amplifier.voltage_limit_v = link_v;
  constexpr double kStep_s = 1e-7;
  Axis axis(p, {.period_s = kStep_s, .substeps = 1}, 1, 0);
  AxisState state = axis.state();
  set_induction_state(state, kFluxed);
  state.shaft.speed_rad_s = 20.0;
  axis.restore(state);
  const InductionMachineConstants c = constants_of(induction(p));
  const RotorMotion still{};
  Freewheel f{.stored_before_j = stored_energy_j(c, kFluxed, still)};
  for (Tick tick = 0; tick < 20'000; ++tick) {
    const InductionMachineState before = induction_state(axis.state());
    const double speed_before = axis.state().shaft.speed_rad_s;
    axis.advance(kOff, tick);
    const InductionMachineState after = induction_state(axis.state());
    const PhaseValues v = axis.state().voltage_v;
    const auto mean = [](double x, double y) { return 0.5 * (x + y); };
    f.into_link_j -=
        kStep_s * (v.a * mean(before.i_a_a, after.i_a_a) + v.b * mean(before.i_b_a, after.i_b_a));
    f.lost_j += kStep_s * mean(losses_w(c, before, still), losses_w(c, after, still));
    f.delivered_j += kStep_s * mean(torque_nm(c, before, still) * speed_before,
                                    torque_nm(c, after, still) * axis.state().shaft.speed_rad_s);
  }
  f.stored_after_j = stored_energy_j(c, induction_state(axis.state()), still);
  return f;
}

// The stored energy goes to the link, into heat and to the shaft; the closing of the sum is limited by the
// step at which a phase opens. Catches: diodes with the voltage of the link the wrong way round, energy that
// vanishes when a phase opens.
TEST(Freewheel, FreewheelingReturnsEnergyToTheLink) {
  const Freewheel f = freewheel(40.0);
  EXPECT_GT(f.into_link_j, 0.25 * f.stored_before_j);
  EXPECT_NEAR(f.stored_before_j, f.stored_after_j + f.into_link_j + f.lost_j + f.delivered_j,
              1e-4 * f.stored_before_j);
}

// Catches: an open machine that conducts below the link voltage, a back-emf that is not shown at the
// terminals.
TEST(Freewheel, ABackEmfBelowTheLinkVoltageDrivesNoCurrent) {
  const InductionMachineState fluxed{.psi_a_wb = 0.05};
  Axis axis = axis_with_link(40.0, fluxed, 200.0);
  axis.advance(kOff, 0);
  EXPECT_EQ(axis.sample(1).true_i_a_a, 0.0);
  EXPECT_EQ(axis.sample(1).true_i_b_a, 0.0);
  EXPECT_EQ(axis.sample(1).torque_nm, 0.0);
  // At the end of the tick, not a substep before: (M/L_R)(n_p w psi_a - psi_b R_R/L_R), the flux turned and
  // decayed. The speed falls a little by friction.
  const double eta_per_s = 3.9 / 0.014;
  const double turned_rad = 600.0 * kServoTick_s;
  const double left_wb = 0.05 * std::exp(-eta_per_s * kServoTick_s);
  const double emf_v =
      0.0117 / 0.014 * left_wb * (600.0 * std::cos(turned_rad) - eta_per_s * std::sin(turned_rad));
  EXPECT_NEAR(axis.sample(1).u_b_v, emf_v, 1e-3 * emf_v);
  for (Tick tick = 1; tick < 100; ++tick)
    axis.advance(kOff, tick);
  // Open, the flux decays with the time constant of the rotor.
  const Sample s = axis.sample(100);
  EXPECT_NEAR(std::hypot(s.psi_a_wb, s.psi_b_wb), 0.05 * std::exp(-100 * kServoTick_s * 3.9 / 0.014), 1e-8);
}

// Catches: diodes that never conduct, or conduct so that they feed the machine.
TEST(Freewheel, ABackEmfAboveTheLinkVoltageChargesTheLinkAndBrakes) {
  const InductionMachineState fluxed{.psi_a_wb = 0.05};
  Axis axis = axis_with_link(15.0, fluxed, 200.0);
  axis.advance(kOff, 0);
  const Sample s = axis.sample(1);
  EXPECT_GT(std::abs(s.true_i_b_a), 0.1);
  EXPECT_LT(s.true_i_b_a * s.u_b_v, 0.0);
  EXPECT_EQ(std::abs(s.u_b_v), 15.0);
  EXPECT_LT(s.torque_nm, 0.0);
}

/// The pieces of the ticks beyond the substeps: each ends at a located event.
int events_of_rectifier(double link_v, int ticks) {
  AxisParameters p = servo_axis();
  p.machine = PmMachineParameters{.pole_pairs = 3,
                                  .stator_resistance_ohm = 0.4,
                                  .inductance_d_h = 1.1e-3,
                                  .inductance_q_h = 1.1e-3,
                                  .torque_constant_nm_per_a = 0.1,
                                  .star = true};
  p.mechanics.inertia_kgm2 = 1e3;
  p.drive.amplifier.voltage_limit_v = link_v;
  Axis axis(p, kServoTiming, 1, 0);
  spin(axis, 300.0);
  int events = 0;
  for (Tick tick = 0; tick < ticks; ++tick) {
    axis.advance(kOff, tick);
    events += static_cast<int>(axis.last_tick().size()) - kServoTiming.substeps;
  }
  return events;
}

// The magnet induces 42 V between two terminals at most, the link takes what is above 30 V: in each
// electrical turn the current of every diode of six ends once. Ten electrical turns, within one at their
// ends. Catches: a diode that begins to conduct with a residue of rounding instead of no current, and dies of
// its sign at once.
TEST(Freewheel, ARectifierOfSixPulsesHasSixEventsInATurn) {
  const double turn_s = 2.0 * 3.14159265358979 / (3.0 * 300.0);
  const int ticks = static_cast<int>(10.0 * turn_s / kServoTick_s);
  for (const double link_v : {5.0, 10.0, 15.0, 20.0}) {
    EXPECT_NEAR(events_of_rectifier(link_v, ticks), 60, 3) << link_v;
  }
}

}  // namespace
}  // namespace drivebench::freewheel_test
