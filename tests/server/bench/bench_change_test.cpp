// Changes around a controller: parameters on a ramp, injected faults, bumps, current set-points, two axes on
// one shaft.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::bench_change_test {
namespace {

constexpr Owner kOwner = 7;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kResistance = "machine.rotor_resistance_ohm";

Refused submit(Bench& bench, const Action& action, Tick tick = 0, std::uint32_t axis = 0) {
  return bench.submit({.tick = tick, .axis = axis, .owner = 0, .action = action});
}

ParameterWrite write(const char* name, double value, Tick ramp_ticks = 0) {
  return write_of(servo_axis(), name, value, ramp_ticks);
}

double resistance_of(const Bench& bench) {
  return value_of(bench.axis(0).parameters(), kResistance);
}

// ---- ramps ----

// Catches: a ramp that starts early, jumps at its end, is not linear, or starts from the value at submission.
TEST(BenchRamp, IsLinearFromThePresentValueAndEndsExactly) {
  Bench bench(servo_setup());
  submit(bench, write(kResistance, 4.9), 3);
  ASSERT_EQ(submit(bench, write(kResistance, 5.9, 4), 5), Refused::kNot);
  std::vector<double> seen;
  for (int i = 0; i < 12; ++i) {
    bench.step();
    seen.push_back(resistance_of(bench));
  }
  // After the step of tick k the value is the one that held during tick k.
  const double from = 4.9;
  const double way = 5.9 - from;
  EXPECT_EQ(seen, (std::vector<double>{3.9, 3.9, 3.9, from, from, from, from + way * 0.25, from + way * 0.5,
                                       from + way * 0.75, 5.9, 5.9, 5.9}));
}

// Catches: a parameter with two ramps at a time, or a step that the old ramp undoes.
TEST(BenchRamp, ANewWriteTakesThePlaceOfTheRamp) {
  Bench bench(servo_setup());
  submit(bench, write(kResistance, 11.9, 8));
  step(bench, 2);
  EXPECT_EQ(resistance_of(bench), 4.9);
  submit(bench, write(kResistance, 3.9, 2));
  step(bench, 2);
  EXPECT_EQ(resistance_of(bench), 4.4);
  step(bench, 3);
  EXPECT_EQ(resistance_of(bench), 3.9);
  submit(bench, write(kResistance, 7.9, 8));
  step(bench, 2);
  submit(bench, write(kResistance, 6.0));
  step(bench, 10);
  EXPECT_EQ(resistance_of(bench), 6.0);
}

/// Live real parameters, more than there may be ramps.
std::vector<std::uint32_t> live_rows() {
  std::vector<std::uint32_t> rows;
  const AxisParameters p = servo_axis();
  for (const Parameter& row : axis_parameters(p)) {
    if (row.live && !row.integer)
      rows.push_back(static_cast<std::uint32_t>(&row - axis_parameters(p).data()));
  }
  return rows;
}

// Catches: a seventeenth ramp that overwrites memory or another ramp; room that is never given back; ramps of
// one axis that take the room of another.
TEST(BenchRamp, AnAxisHasAtMostSixteenAtATime) {
  BenchSetup setup = servo_setup();
  setup.axes.push_back(setup.axes[0]);
  Bench bench(setup);
  const std::vector<std::uint32_t> rows = live_rows();
  ASSERT_GT(rows.size(), kMaxRamps);
  const auto ramp = [&](std::size_t n, Tick ticks, std::uint32_t axis = 0) {
    const double value = axis_parameters(servo_axis())[rows[n]].get(servo_axis());
    return submit(bench, ParameterWrite{.row = rows[n], .value = value, .ramp_ticks = ticks}, 0, axis);
  };
  for (std::size_t n = 0; n < kMaxRamps; ++n)
    ASSERT_EQ(ramp(n, n == 3 ? 2 : 5), Refused::kNot) << n;
  EXPECT_EQ(ramp(kMaxRamps, 5), Refused::kTooManyRamps);
  EXPECT_EQ(ramp(3, 2), Refused::kNot) << "it takes the place of its own ramp";
  EXPECT_EQ(ramp(kMaxRamps, 0), Refused::kNot) << "a step needs no room";
  EXPECT_EQ(ramp(kMaxRamps, 5, 1), Refused::kNot) << "another axis has room of its own";
  step(bench, 3);
  EXPECT_EQ(ramp(kMaxRamps, 5), Refused::kNot);
  EXPECT_EQ(ramp(3, 5), Refused::kTooManyRamps);
  EXPECT_EQ(bench.sample(0).refused_commands, 0u) << "the answer tells of it";
}

// Static friction may not be below Coulomb friction. Catches: a rule that only the first value of a ramp
// keeps, a rule that stops all other ramps too, a scheduled write whose refusal leaves no trace.
TEST(BenchRamp, StopsWhereItWouldBreakARule) {
  Bench bench(servo_setup());
  submit(bench, write("mechanics.static_friction_nm", 0.02));
  submit(bench, write("mechanics.coulomb_friction_nm", 0.04, 4));
  submit(bench, write(kResistance, 5.9, 4));
  step(bench, 10);
  EXPECT_EQ(value_of(bench.axis(0).parameters(), "mechanics.coulomb_friction_nm"), 0.02);
  EXPECT_EQ(resistance_of(bench), 5.9);
  EXPECT_EQ(bench.sample(0).refused_commands, 1u);
  EXPECT_EQ(submit(bench, write("mechanics.static_friction_nm", 0.01)), Refused::kRuleBroken);
  EXPECT_EQ(submit(bench, write("mechanics.static_friction_nm", 0.01), 20), Refused::kNot);
  step(bench, 20);
  EXPECT_EQ(value_of(bench.axis(0).parameters(), "mechanics.static_friction_nm"), 0.02);
  EXPECT_EQ(bench.sample(0).refused_commands, 2u);
}

// Catches: values that make the plant diverge, rows from a damaged file that read past the table, an integer
// that goes through a half.
TEST(BenchRamp, HostileWritesAreRefused) {
  Bench bench(servo_setup());
  const std::uint64_t before = bench.axis(0).parameters().machine.index();
  const auto rows = static_cast<std::uint32_t>(axis_parameters(servo_axis()).size());
  EXPECT_EQ(submit(bench, write(kResistance, kNan)), Refused::kNotFinite);
  EXPECT_EQ(submit(bench, write(kResistance, HUGE_VAL, 5)), Refused::kNotFinite);
  EXPECT_EQ(submit(bench, write(kResistance, -1.0, 5)), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, ParameterWrite{.row = rows, .value = 1.0}), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, ParameterWrite{.row = ~0u, .value = 1.0, .ramp_ticks = 1}), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, write("amplifier.over_current_trip", 0.5)), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, write("amplifier.over_current_trip", 0.0, 10)), Refused::kNot);
  bench.step();
  EXPECT_EQ(value_of(bench.axis(0).parameters(), "amplifier.over_current_trip"), 0.0) << "at once";
  EXPECT_EQ(submit(bench, write(kResistance, 5.0, std::numeric_limits<Tick>::max())), Refused::kNot);
  EXPECT_EQ(submit(bench, write(kResistance, 5.0, std::numeric_limits<Tick>::min())), Refused::kNot);
  bench.step();
  EXPECT_EQ(resistance_of(bench), 5.0);
  EXPECT_EQ(bench.axis(0).parameters().machine.index(), before);
  EXPECT_EQ(bench.sample(0).faults, 0u);
}

// Catches: a change that is not counted, or that is counted without end.
TEST(BenchRamp, ChangesAreCounted) {
  Bench bench(servo_setup());
  const std::uint64_t start = bench.parameter_changes(0);
  submit(bench, write(kResistance, 5.0));
  EXPECT_EQ(bench.parameter_changes(0), start + 1);
  submit(bench, write(kResistance, 6.0, 3));
  step(bench, 10);
  EXPECT_EQ(bench.parameter_changes(0), start + 5) << "ticks 0 to 3 of the ramp";
  submit(bench, write(kResistance, -6.0));
  EXPECT_EQ(bench.parameter_changes(0), start + 5);
}

// ---- faults and bumps ----

// Catches: a fault that acts on another row, early, on another axis, or that does not go away.
TEST(BenchFault, IsInForceFromItsTickToItsEnd) {
  BenchSetup setup = servo_setup();
  setup.axes.push_back(setup.axes[0]);
  Bench bench(setup);
  const auto drift = static_cast<std::uint32_t>(find_injectable_fault("rotor_resistance_drift"));
  submit(bench, fault_of("rotor_resistance_drift", 0.5), 3, 1);
  submit(bench, fault_of("rotor_resistance_drift", 0.0), 5, 1);
  for (Tick tick = 1; tick < 8; ++tick) {
    bench.step();
    EXPECT_EQ(bench.sample(0).injected, 0u);
    EXPECT_EQ(bench.sample(1).injected, tick == 4 || tick == 5 ? std::uint64_t{1} << drift : 0u) << tick;
  }
}

// Catches: a row or value from a damaged file that is believed.
TEST(BenchFault, HostileFaultsAndBumpsAreRefused) {
  Bench bench(servo_setup());
  EXPECT_EQ(submit(bench, InjectFault{.row = kInjectableFaultCount, .value = 1.0}), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, InjectFault{.row = ~0u, .value = 0.0}), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, fault_of("open_phase", 4.0)), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, fault_of("open_phase", 0.5)), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, fault_of("open_phase", -1.0)), Refused::kOutOfRange);
  EXPECT_EQ(submit(bench, fault_of("bus_sag", kNan)), Refused::kNotFinite);
  EXPECT_EQ(submit(bench, ShaftBump{kNan}), Refused::kNotFinite);
  EXPECT_EQ(submit(bench, ShaftBump{-HUGE_VAL}), Refused::kNotFinite);
  EXPECT_EQ(submit(bench, fault_of("open_phase", 4.0), 2), Refused::kNot) << "judged when its tick comes";
  step(bench, 3);
  EXPECT_EQ(bench.sample(0).injected, 0u);
  EXPECT_EQ(bench.sample(0).speed_rad_s, 0.0);
  EXPECT_EQ(bench.sample(0).refused_commands, 1u);
}

// J w = impulse; what is left after a tick of viscous friction is 1 - 1.6e-4 of it. Catches: a bump that is
// lost, doubled or has the wrong sign.
TEST(BenchBump, ChangesTheSpeedByItsImpulse) {
  Bench bench(servo_setup());
  submit(bench, ShaftBump{.impulse_nms = -2.0 * kServoInertia_kgm2}, 2);
  step(bench, 2);
  EXPECT_EQ(bench.sample(0).speed_rad_s, 0.0);
  bench.step();
  EXPECT_NEAR(bench.sample(0).speed_rad_s, -2.0, 1e-3);
}

// The answers go on, so that a controller in lockstep is not stopped; only the drive gets nothing. Catches: a
// lost command that feeds the watchdog or reaches the plant, a lease that runs out although its holder talks,
// a bench that stops.
TEST(BenchFault, CMD_02_CommandLossKeepsCommandsFromTheDriveAndTheWatchdogSeesIt) {
  BenchSetup setup = servo_setup();
  setup.watchdog_ticks = 10;
  setup.lease_ticks = 15;
  Bench bench = owned_bench(setup, kOwner);
  submit_volts(bench, kOwner, 5.0);
  bench.step();
  submit(bench, fault_of("command_loss", 1.0));
  for (int i = 0; i < 9; ++i) {
    ASSERT_EQ(submit_volts(bench, kOwner, 9.0), Refused::kNot);
    EXPECT_TRUE(bench.has_command(0)) << "lockstep goes on";
    bench.step();
    EXPECT_EQ(bench.sample(0).u_a_v, 5.0) << "the last command that came holds";
    EXPECT_EQ(state_of(bench), ControlState::kHold);
  }
  EXPECT_EQ(bench.sample(0).missed_commands, 9u);
  submit_volts(bench, kOwner, 9.0);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, kCommandTimeout);
  EXPECT_EQ(state_of(bench), ControlState::kTimeout);
  step(bench, 10);
  EXPECT_EQ(bench.owner(0), kOwner);
  submit(bench, fault_of("command_loss", 0.0));
  EXPECT_EQ(submit_clear(bench, kOwner), Refused::kNot);
  submit_volts(bench, kOwner, 9.0);
  bench.step();
  EXPECT_EQ(bench.sample(0).u_a_v, 9.0);
}

// Catches: a copy that feeds the watchdog, that reaches the drive after a newer command, or that is not
// counted; an axis that is armed by a link which sends each command twice.
TEST(BenchFault, CMD_06_CopiesThatTheLinkMakesAreRefusedAndCounted) {
  BenchSetup setup = servo_setup();
  setup.watchdog_ticks = 3;
  Bench bench = owned_bench(setup, kOwner);
  submit(bench, fault_of("command_duplication", 2.0));
  for (std::uint64_t i = 1; i <= 5; ++i) {
    ASSERT_EQ(submit_volts(bench, kOwner, static_cast<double>(i)), Refused::kNot);
    bench.step();
    EXPECT_EQ(bench.sample(0).u_a_v, static_cast<double>(i));
    EXPECT_EQ(bench.sample(0).refused_commands, 2 * i);
    EXPECT_NE(bench.sample(0).injected, 0u);
  }
  step(bench, 3);
  EXPECT_EQ(bench.sample(0).faults, kCommandTimeout);
  EXPECT_EQ(bench.sample(0).refused_commands, 10u);

  setup.arming_commands = 2;
  Bench arming = owned_bench(setup, kOwner);
  submit(arming, fault_of("command_duplication", 1.0));
  for (int i = 0; i < 5; ++i) {
    submit_volts(arming, kOwner, 5.0);
    arming.step();
    EXPECT_EQ(state_of(arming), ControlState::kReady);
  }
  submit(arming, fault_of("command_duplication", 0.0));
  for (int i = 0; i < 2; ++i) {
    submit_volts(arming, kOwner, 5.0);
    arming.step();
  }
  EXPECT_EQ(state_of(arming), ControlState::kRun);
}

// ---- set-points ----

BenchSetup current_setup() {
  BenchSetup setup = servo_setup();
  DriveParameters& drive = setup.axes[0].parameters.drive;
  drive.kind = DriveKind::kCurrent;
  drive.amplifier.voltage_limit_v = 80.0;
  drive.current_loop = {.proportional_v_per_a = 50.0, .integral_v_per_as = 5e4, .limit_a = 6.0};
  setup.substeps = 7;  // of 17.9 us
  return setup;
}

Command amperes(Tick answers, PhaseValues i) {
  return {.answers = answers, .phases = {.gates = Gates::kCurrent, .setpoint = i}};
}

// Catches: currents that a voltage amplifier takes for volts; a refusal that is not counted.
TEST(BenchSetpoint, CurrentsAreForCurrentAmplifiersOnly) {
  Bench bench = owned_bench(servo_setup(), kOwner);
  const Command command = amperes(0, {.a = 1.0});
  EXPECT_EQ(judge(command, kOwner, bench.command_view(0)), Refused::kWrongDrive);
  EXPECT_EQ(bench.submit({.axis = 0, .owner = kOwner, .action = command}), Refused::kWrongDrive);
  bench.step();
  EXPECT_EQ(bench.sample(0).refused_commands, 1u);
  EXPECT_EQ(bench.sample(0).u_a_v, 0.0);

  Bench current = owned_bench(current_setup(), kOwner);
  for (int i = 0; i < 40; ++i) {
    const Refused why = current.submit(
        {.tick = current.tick(), .axis = 0, .owner = kOwner, .action = amperes(current.tick(), {.a = 2.0})});
    ASSERT_EQ(why, Refused::kNot);
    current.step();
  }
  EXPECT_NEAR(current.sample(0).true_i_a_a, 2.0, 0.05);
  EXPECT_NEAR(current.sample(0).true_i_b_a, 0.0, 0.05);
}

// Catches: a check of two set-points of the four.
TEST(BenchSetpoint, AllFourMustBeFinite) {
  Bench bench = owned_bench(current_setup(), kOwner);
  for (double PhaseValues::*member :
       {&PhaseValues::a, &PhaseValues::b, &PhaseValues::c, &PhaseValues::field}) {
    for (const Gates gates : {Gates::kVoltage, Gates::kCurrent, Gates::kOff}) {
      Command command{.answers = 0, .phases = {.gates = gates, .setpoint = {}}};
      command.phases.setpoint.*member = kNan;
      EXPECT_EQ(judge(command, kOwner, bench.command_view(0)), Refused::kNotFinite);
    }
  }
  EXPECT_EQ(judge(amperes(0, {.c = 1.0, .field = 1.0}), kOwner, bench.command_view(0)), Refused::kNot);
}

// ---- a dynamometer ----

BenchSetup dynamometer() {
  BenchSetup setup = servo_setup();
  setup.axes[0].parameters.mechanics.inertia_kgm2 *= 2.0;
  setup.axes.push_back({.parameters = servo_axis(), .shares_shaft_with = 0});
  return setup;
}

/// A rotating voltage on one axis.
void turn(Bench& bench, std::uint32_t axis, double amplitude_v) {
  const double angle = 2.0 * 3.14159265358979 * 20.0 * kServoTick_s * static_cast<double>(bench.tick());
  bench.submit({.tick = bench.tick(),
                .axis = axis,
                .owner = kOwner,
                .action = volts_in_answer_to(bench.tick(), amplitude_v * std::cos(angle),
                                             amplitude_v * std::sin(angle))});
}

// Catches: a second axis that stands still, turns on its own, or is advanced twice; a bump or a load on it
// that moves neither.
TEST(BenchSharedShaft, BothAxesTurnAsOne) {
  Bench bench(dynamometer());
  submit_lease(bench, LeaseAction::kAcquire, kOwner);
  for (int i = 0; i < 400; ++i) {
    turn(bench, 0, 40.0);
    bench.step();
    ASSERT_EQ(bench.sample(0).speed_rad_s, bench.sample(1).speed_rad_s) << "tick " << i;
  }
  EXPECT_GT(bench.sample(1).speed_rad_s, 5.0);
  EXPECT_NE(bench.sample(0).true_i_a_a, 0.0);
  EXPECT_EQ(bench.sample(1).encoder_count, bench.sample(0).encoder_count);
  const double before = bench.sample(0).speed_rad_s;
  submit(bench, ShaftBump{20.0 * kServoInertia_kgm2}, 0, 1);
  turn(bench, 0, 40.0);
  bench.step();
  EXPECT_NEAR(bench.sample(0).speed_rad_s - before, 10.0, 1.0) << "20 J over the inertia 2 J";
  EXPECT_EQ(bench.sample(0).speed_rad_s, bench.sample(1).speed_rad_s);
  submit(bench, LoadChange{.load_nm = 100.0 * kServoInertia_kgm2, .ramp_ticks = 0}, 0, 1);
  const double loaded = bench.sample(0).speed_rad_s;
  for (int i = 0; i < 400; ++i) {
    bench.step();
  }
  EXPECT_LT(bench.sample(0).speed_rad_s, loaded);
}

// The second rotor turns with the output of a gear of ratio 4, whose inertia is 16 times that of the rotor.
// Catches: a bump on the second axis that lands on the rotor of the first, a blocked rotor there that turns.
TEST(BenchSharedShaft, ABumpAndALockOnTheSecondAxisActAtTheOutput) {
  BenchSetup setup = dynamometer();
  setup.axes[0].parameters.mechanics.gear_ratio = 4.0;
  setup.axes[0].parameters.mechanics.viscous_friction_nms = 0.0;
  Bench bench(setup);
  submit(bench, ShaftBump{64.0 * kServoInertia_kgm2}, 0, 1);
  bench.step();
  EXPECT_NEAR(bench.sample(0).speed_rad_s, 64.0 / 4.0 / 2.0, 1e-9);
  EXPECT_NEAR(bench.sample(1).speed_rad_s, 64.0 / 4.0 / 4.0 / 2.0, 1e-9);
  submit(bench, fault_of("blocked_rotor", 1.0), 0, 1);
  bench.step();
  EXPECT_EQ(bench.sample(0).speed_rad_s, 0.0);
  EXPECT_EQ(bench.sample(1).speed_rad_s, 0.0);
}

// Catches: a state of the pair that is not saved, a state of two free axes that is taken for it.
TEST(BenchSharedShaft, IsSavedAndRestored) {
  Bench original(dynamometer());
  submit_lease(original, LeaseAction::kAcquire, kOwner);
  for (int i = 0; i < 100; ++i) {
    turn(original, 0, 40.0);
    original.step();
  }
  Bench copy(dynamometer());
  ASSERT_TRUE(copy.restore(original.save()));
  step(original, 200);
  step(copy, 200);
  EXPECT_EQ(copy.state_hash(), original.state_hash());
  BenchSetup apart = dynamometer();
  apart.axes[1].shares_shaft_with.reset();
  EXPECT_FALSE(Bench(apart).restore(original.save()));
}

}  // namespace
}  // namespace drivebench::bench_change_test
