// The safe actions, and the ways out of them.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::safe_action_test {
namespace {

constexpr Owner kOwner = 7;
constexpr double kSpeed_rad_s = 200.0;
constexpr double kInertia_kgm2 = 10.0;  // so that the speed stays while the currents settle
constexpr PmMachineParameters kMagnet{.pole_pairs = 4,
                                      .stator_resistance_ohm = 0.5,
                                      .inductance_d_h = 0.002,
                                      .inductance_q_h = 0.002,
                                      .torque_constant_nm_per_a = 0.2};

/// A machine with magnets (40 V at the speed that it gets) on a link of this voltage; its controller falls
/// silent at once.
Bench abandoned_magnet(SafeAction action, double link_v, double capacitance_f = 0.0) {
  BenchSetup setup;
  setup.command_delay_ticks = 0;
  setup.substeps = 10;
  setup.watchdog_ticks = 1;
  AxisSetup axis{.parameters = {}, .on_link_loss = action};
  axis.parameters.machine = kMagnet;
  axis.parameters.mechanics.inertia_kgm2 = kInertia_kgm2;
  axis.parameters.drive.amplifier = {.voltage_limit_v = link_v, .over_current_a = 1000.0};
  axis.parameters.drive.bus.capacitance_f = capacitance_f;
  setup.axes.push_back(axis);
  Bench bench = owned_bench(setup, kOwner);
  bench.submit({.axis = 0, .owner = kOwner, .action = ShaftBump{kInertia_kgm2 * kSpeed_rad_s}});
  submit_volts(bench, kOwner, 0.0);
  step(bench, 1600);
  EXPECT_EQ(bench.sample(0).faults & kLatchedFaults, kCommandTimeout);
  return bench;
}

double current_a(const Bench& bench) {
  return std::hypot(bench.sample(0).true_i_a_a, bench.sample(0).true_i_b_a);
}

double vector_length(const PhaseValues& x) {
  const TwoPhase v = three_to_two({x.a, x.b, x.c});
  return std::hypot(v.a, v.b);
}

// With all terminals at one potential: L i' = -R i - emf turns with the electrical speed, whose steady
// magnitude is K w/|R + j n_p w L|, 24 A here and K/(n_p L) = 25 A at high speed; the heat R i^2 comes from
// the shaft. Tolerance: the speed falls by 0.2 % in the 0.2 s. Catches: a short circuit that frees the shaft,
// or holds the voltages.
TEST(SafeAction, STATE_02_ZeroVoltageIsAnActiveShortCircuitThatBrakes) {
  const Bench bench = abandoned_magnet(SafeAction::kZeroVoltage, 100.0);
  const double speed_rad_s = bench.sample(0).speed_rad_s;
  const double reactance_ohm = kMagnet.pole_pairs * speed_rad_s * kMagnet.inductance_d_h;
  const double expected_a = kMagnet.torque_constant_nm_per_a * speed_rad_s /
                            std::hypot(kMagnet.stator_resistance_ohm, reactance_ohm);
  EXPECT_NEAR(current_a(bench), expected_a, 2e-3 * expected_a);
  EXPECT_NEAR(-bench.sample(0).torque_nm * speed_rad_s,
              kMagnet.stator_resistance_ohm * expected_a * expected_a, 1.0);
}

// Catches: gates off as an open circuit, whatever the emf; diodes that conduct against the link.
TEST(SafeAction, STATE_02_FreewheelConductsIntoTheLinkWhenTheEmfExceedsIt) {
  const Bench below = abandoned_magnet(SafeAction::kFreewheel, 60.0);
  EXPECT_EQ(current_a(below), 0.0);
  EXPECT_NEAR(below.sample(0).speed_rad_s, kSpeed_rad_s, 1e-4) << "braked in the one tick at 0 V only";

  const Bench above = abandoned_magnet(SafeAction::kFreewheel, 20.0, 1e-3);
  EXPECT_GT(above.sample(0).bus_voltage_v, 35.0) << "the emf charges the link from 20 V towards its 40 V";
  const double speed_rad_s = above.sample(0).speed_rad_s;
  const double lost_j = 0.5 * kInertia_kgm2 * (kSpeed_rad_s * kSpeed_rad_s - speed_rad_s * speed_rad_s);
  const double stored_j = 0.5 * 1e-3 * (std::pow(above.sample(0).bus_voltage_v, 2) - 20.0 * 20.0);
  EXPECT_GT(lost_j, stored_j) << "what the link has gained came from the shaft, and the copper took its part";
}

// Catches: set-points that turn on, fade or change in a bit; a hold that outlasts its clear, or that drives a
// tripped axis.
TEST(SafeAction, STATE_02_HoldKeepsTheLastVoltagesUntilItIsClearedOrTheAxisTrips) {
  BenchSetup setup = servo_setup(1);
  setup.watchdog_ticks = 3;
  setup.axes[0].on_link_loss = SafeAction::kHold;
  Bench bench = owned_bench(setup, kOwner);
  for (int i = 0; i < 5; ++i) {
    submit_volts(bench, kOwner, 3.1, -4.7);
    bench.step();
  }
  step(bench, 1000);
  EXPECT_EQ(state_of(bench), ControlState::kTimeout);
  EXPECT_EQ(bench.sample(0).u_a_v, 3.1);
  EXPECT_EQ(bench.sample(0).u_b_v, -4.7);
  EXPECT_NEAR(bench.sample(0).true_i_a_a, 3.1 / kServoMachine.stator_resistance_ohm, 1e-3)
      << "a direct current";

  Bench cleared = bench;
  EXPECT_EQ(submit_clear(cleared, kOwner), Refused::kNot);
  step(cleared, 200);
  EXPECT_EQ(current_a(cleared), 0.0);

  bench.submit({.axis = 0, .owner = 0, .action = Overrun{}});
  step(bench, 200);
  EXPECT_EQ(state_of(bench), ControlState::kFault);
  EXPECT_EQ(current_a(bench), 0.0);
}

// The last commands turn by 0.05 rad in a tick. In tick m of n of the ramp the magnitude is 1 - m/n and the
// angle 0.05 (m - m^2/2n) further; tolerance: rounding. Catches: a frequency that stays or is not known at
// all, a ramp of the wrong length, voltages that jump when it begins or ends.
TEST(SafeAction, STATE_02_QuickStopRampsMagnitudeAndFrequencyToZeroAndThenFreewheels) {
  constexpr Tick kRamp = 400;
  constexpr double kTurn_rad = 0.05;
  constexpr double kVolts = 20.0;
  BenchSetup setup = servo_setup();
  setup.watchdog_ticks = 1;
  setup.axes[0].on_link_loss = SafeAction::kQuickStop;
  setup.axes[0].quick_stop_ticks = kRamp;
  Bench bench = owned_bench(setup, kOwner);
  double angle_rad = 0.0;
  for (int i = 0; i < 300; ++i) {
    angle_rad = kTurn_rad * i;
    submit_volts(bench, kOwner, kVolts * std::cos(angle_rad), kVolts * std::sin(angle_rad));
    bench.step();
  }
  for (Tick m = 1; m < kRamp; ++m) {
    bench.step();
    const double part = static_cast<double>(m) / static_cast<double>(kRamp);
    const double turned_rad = angle_rad + kTurn_rad * static_cast<double>(m) * (1.0 - 0.5 * part);
    ASSERT_NEAR(bench.sample(0).u_a_v, kVolts * (1.0 - part) * std::cos(turned_rad), 1e-9) << m;
    ASSERT_NEAR(bench.sample(0).u_b_v, kVolts * (1.0 - part) * std::sin(turned_rad), 1e-9) << m;
  }
  step(bench, 100);
  EXPECT_EQ(state_of(bench), ControlState::kTimeout);
  EXPECT_EQ(current_a(bench), 0.0);
}

// Catches: an armature whose voltage is turned, a field winding that the ramp takes away.
TEST(SafeAction, AQuickStopOfAnArmatureBrakesAgainstItsField) {
  LastCommands last;
  follow(last, {.gates = Gates::kVoltage, .setpoint = {.a = 12.0, .field = 5.0}}, Connection::kArmature,
         true);
  for (Tick m = 1; m < 4; ++m) {
    const PhaseCommand command = act_safely(last, SafeAction::kQuickStop, false, Connection::kArmature, 4);
    EXPECT_EQ(command.gates, Gates::kVoltage);
    EXPECT_EQ(command.setpoint.a, 12.0 * (1.0 - static_cast<double>(m) / 4.0));
    EXPECT_EQ(command.setpoint.field, 5.0);
  }
  EXPECT_EQ(act_safely(last, SafeAction::kQuickStop, false, Connection::kArmature, 4).gates, Gates::kOff);
}

// Catches: duties of a star whose vector shrinks towards the lower rail, so that turned legs come beyond it;
// a leg that stays off while the vector turns; a hold that switches it on.
TEST(SafeAction, AQuickStopOfDutiesShrinksAboutTheMiddleWithAllLegs) {
  const PhaseCommand clamped{
      .gates = Gates::kDuty, .legs_off = 1, .setpoint = {.a = 1.0, .b = 0.0, .c = 0.3}};
  LastCommands last;
  follow(last, clamped, Connection::kStar, true);
  last.turn_rad_per_tick = 0.5;
  const double size = vector_length(clamped.setpoint);
  for (Tick m = 1; m < 8; ++m) {
    const PhaseCommand command = act_safely(last, SafeAction::kQuickStop, false, Connection::kStar, 8);
    EXPECT_EQ(command.gates, Gates::kDuty);
    EXPECT_EQ(command.legs_off, 0u);
    const PhaseValues& d = command.setpoint;
    EXPECT_NEAR(d.a + d.b + d.c, 1.5, 1e-12);
    EXPECT_NEAR(vector_length(d), size * (1.0 - static_cast<double>(m) / 8.0), 1e-12);
  }
  LastCommands held;
  follow(held, clamped, Connection::kStar, false);
  EXPECT_EQ(act_safely(held, SafeAction::kHold, false, Connection::kStar, 8).legs_off, 1u);
}

// Six steps of 60 degrees, 20 ticks each, are 0.0524 rad per tick. Catches: a mean over so few commands that
// it sees only the standstill between two steps.
TEST(SafeAction, TheFrequencyOfBlockCommutationIsThatOfItsSteps) {
  LastCommands last;
  constexpr double kStep_rad = std::numbers::pi / 3.0;
  for (int i = 0; i < 600; ++i) {
    const double angle_rad = kStep_rad * (i / 20);
    const ThreePhase u = two_to_three({.a = 10.0 * std::cos(angle_rad), .b = 10.0 * std::sin(angle_rad)});
    follow(last, {.gates = Gates::kVoltage, .setpoint = {.a = u.a, .b = u.b, .c = u.c}}, Connection::kStar,
           true);
  }
  EXPECT_NEAR(last.turn_rad_per_tick, kStep_rad / 20.0, 0.2 * kStep_rad / 20.0);
}

// Catches: an axis that is driven by the first frame of a controller that is only starting, a row of commands
// that goes on behind a bad one or behind a silence.
TEST(SafeAction, STATE_01_OnlyARowOfGoodCommandsArmsAnAxis) {
  BenchSetup setup = servo_setup();
  setup.arming_commands = 10;
  setup.watchdog_ticks = 5;
  Bench bench = owned_bench(setup, kOwner);
  const auto send = [&bench](int count) {
    for (int i = 0; i < count; ++i) {
      EXPECT_EQ(submit_volts(bench, kOwner, 2.0), Refused::kNot);
      bench.step();
    }
  };
  bench.step();
  EXPECT_EQ(state_of(bench), ControlState::kIdle) << "a lease alone is no stream";
  send(9);
  EXPECT_EQ(state_of(bench), ControlState::kReady);
  EXPECT_EQ(current_a(bench), 0.0);
  EXPECT_EQ(submit_volts(bench, kOwner, std::nan("")), Refused::kNotFinite);
  send(9);
  EXPECT_EQ(state_of(bench), ControlState::kReady);
  step(bench, 4);
  EXPECT_EQ(state_of(bench), ControlState::kReady) << "a slow controller may be silent as long as in run";
  step(bench, 1);
  EXPECT_EQ(state_of(bench), ControlState::kIdle);
  EXPECT_EQ(bench.sample(0).missed_commands, 0u) << "nothing was owed yet";
  send(10);
  EXPECT_EQ(state_of(bench), ControlState::kRun);
  EXPECT_EQ(bench.sample(0).u_a_v, 2.0);
}

// Catches: a clear that starts what trips at once again; a cause that stays for ever.
TEST(SafeAction, CMD_04_AFaultIsNotClearedWhileItsCauseLasts) {
  const std::size_t loss = find_injectable_fault("command_loss");
  const auto inject = [](Bench& bench, double value) {
    bench.submit({.axis = 0, .owner = 0, .action = InjectFault{static_cast<std::uint32_t>(loss), value}});
  };
  BenchSetup setup = servo_setup();
  setup.watchdog_ticks = 2;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 5.0);
  bench.step();
  inject(bench, 1.0);
  step(bench, 2);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kCauseLasts);
  inject(bench, 0.0);
  EXPECT_EQ(submit_volts(bench, kOwner, std::nan("")), Refused::kNotFinite);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kCauseLasts) << "its controller still computes nonsense";
  const Command off{.answers = bench.tick(), .phases = {}};
  EXPECT_EQ(bench.submit({.axis = 0, .owner = kOwner, .action = off}), Refused::kNot);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
}

// The break input of a drive: its line opens the legs, and a clear is refused while it is pulled. Catches: a
// latch that a command undoes, a state of the axis that goes on running, a clear that trips at once again.
TEST(SafeAction, TheFaultLineOfTheGateDriverHoldsItsLatch) {
  constexpr auto kLine = static_cast<std::uint32_t>(find_injectable_fault("gate_driver_fault"));
  const auto pull = [](Bench& bench, double value) {
    bench.submit({.axis = 0, .owner = 0, .action = InjectFault{kLine, value}});
  };
  Bench bench = owned_bench(servo_setup(), kOwner);
  submit_volts(bench, kOwner, 5.0);
  bench.step();
  pull(bench, 1.0);
  submit_volts(bench, kOwner, 5.0);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, kBreakInput);
  EXPECT_EQ(submit_volts(bench, kOwner, 5.0), Refused::kLatched);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kCauseLasts);
  bench.step();
  EXPECT_EQ(state_of(bench), ControlState::kFault);
  pull(bench, 0.0);
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
  submit_volts(bench, kOwner, 5.0);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, 0u);
  EXPECT_EQ(bench.sample(0).u_a_v, 5.0);
}

}  // namespace
}  // namespace drivebench::safe_action_test
