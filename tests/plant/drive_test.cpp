#include "plant/drive/drive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "tests/plant/drive_rig.hpp"

namespace drivebench::drive_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The command of a tick whose number it tells.
PhaseCommand numbered(Tick tick) {
  return volts(static_cast<double>(tick + 1), -static_cast<double>(tick + 1));
}

/// Voltage of phase a at an instant of the tick that has begun; 0 with the gates off.
double voltage_at(DriveRig& rig, double start_s) {
  const TerminalDrive out = rig.drive.at(rig.memory, start_s, 1e-9, {});
  return out.mode[0] == TerminalMode::kDriven ? out.start_v.a : 0.0;
}

// Catches: gain or offset left out, a limit of the wrong height, a flag that sticks, phases that do not
// exist.
TEST(Drive, TheVoltageAmplifierPutsOutTheLimitedCommand) {
  DriveParameters p = plain_drive();
  p.amplifier.gain = 2.0;
  p.amplifier.offset_b_v = -1.0;
  p.amplifier.offset_c_v = 5.0;
  DriveRig rig(p, Connection::kTwoPhase);
  rig.drive.begin_tick(rig.memory, volts(10.0, 20.0, 30.0), {}, 0);
  TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-5, {});
  EXPECT_TRUE(out.constant);
  EXPECT_EQ(out.start_v.a, 20.0);
  EXPECT_EQ(out.start_v.b, 39.0);
  EXPECT_EQ(out.start_v.c, 0.0);
  EXPECT_EQ(out.rail_v, 100.0);
  EXPECT_EQ(rig.memory.saturated, 0.0);
  EXPECT_EQ(rig.drive.next_edge_s(rig.memory, 0.0), kInfinity);
  rig.drive.begin_tick(rig.memory, volts(10.0, -51.0, 1e9), {}, 1);
  out = rig.drive.at(rig.memory, 5e-5, 1e-5, {});
  EXPECT_EQ(out.start_v.b, -100.0);
  EXPECT_EQ(rig.memory.saturated, 1.0);
  rig.drive.begin_tick(rig.memory, volts(10.0), {}, 2);
  EXPECT_EQ(rig.memory.saturated, 0.0);
}

// Catches: an offset or a stale voltage with the terminals shorted, diodes at the wrong rail, a current
// command that is taken for volts.
TEST(Drive, TheGatesDecideWhatHoldsTheTerminals) {
  for (const DriveKind kind :
       {DriveKind::kVoltage, DriveKind::kCurrent, DriveKind::kAveraged, DriveKind::kSwitched}) {
    for (const Connection connection : {Connection::kTwoPhase, Connection::kStar}) {
      DriveParameters p = plain_drive(kind);
      p.amplifier.offset_a_v = 1.0;
      p.current_loop = {.proportional_v_per_a = 1.0, .limit_a = 5.0};
      DriveRig rig(p, connection);
      rig.drive.begin_tick(rig.memory, {.gates = Gates::kZeroVoltage, .setpoint = {.a = 50.0}}, {}, 0);
      TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-5, {});
      EXPECT_EQ(out.mode[1], TerminalMode::kDriven);
      EXPECT_EQ(out.start_v.a, 0.0);
      EXPECT_EQ(out.start_v.b, 0.0);
      rig.drive.begin_tick(rig.memory, {.gates = Gates::kOff, .setpoint = {.a = 50.0}}, {}, 1);
      out = rig.drive.at(rig.memory, 0.0, 1e-5, {});
      EXPECT_EQ(out.mode[0], TerminalMode::kDiodes);
      EXPECT_EQ(out.mode[1], TerminalMode::kDiodes);
      EXPECT_EQ(out.rail_v, 100.0);
      rig.drive.begin_tick(rig.memory, amperes(1.0), {}, 2);
      out = rig.drive.at(rig.memory, 0.0, 1e-5, {});
      EXPECT_EQ(out.mode[0], kind == DriveKind::kCurrent ? TerminalMode::kDriven : TerminalMode::kDiodes);
      EXPECT_EQ(rig.memory.saturated, 0.0);
    }
  }
}

// Catches: a delay rounded to ticks, rounded the wrong way, an edge in the wrong part, a first command too
// early.
TEST(Drive, ADelayOf1Point6TicksSwitchesWithinTheTick) {
  DriveParameters p = plain_drive();
  p.amplifier.delay_ticks = 1.6;
  DriveRig rig(p, Connection::kTwoPhase);
  for (Tick tick = 0; tick < 60; ++tick) {
    rig.drive.begin_tick(rig.memory, numbered(tick), {}, tick);
    const double edge_s = rig.drive.next_edge_s(rig.memory, 0.0);
    EXPECT_NEAR(edge_s, 0.6 * kRigTick_s, 1e-18);
    EXPECT_EQ(rig.drive.next_edge_s(rig.memory, edge_s), kInfinity);
    EXPECT_EQ(voltage_at(rig, 0.0), tick >= 2 ? static_cast<double>(tick - 1) : 0.0);
    EXPECT_EQ(voltage_at(rig, 0.99 * edge_s), tick >= 2 ? static_cast<double>(tick - 1) : 0.0);
    EXPECT_EQ(voltage_at(rig, edge_s), tick >= 1 ? static_cast<double>(tick) : 0.0);
  }
}

// Catches: a ring that is too short or runs over, an injected delay that replaces the other.
TEST(Drive, DelaysAddUpToTheLongest) {
  DriveParameters p = plain_drive();
  p.amplifier.delay_ticks = 7.5;
  InjectedFaults faults;
  faults.command_delay = 16.0;
  DriveRig rig(p, Connection::kTwoPhase);
  for (Tick tick = 0; tick < 90; ++tick) {
    rig.drive.begin_tick(rig.memory, numbered(tick), faults, tick);
    EXPECT_EQ(voltage_at(rig, 0.0), tick >= 24 ? static_cast<double>(tick - 23) : 0.0) << tick;
    EXPECT_EQ(voltage_at(rig, 0.8 * kRigTick_s), tick >= 23 ? static_cast<double>(tick - 22) : 0.0) << tick;
  }
  rig.drive.begin_tick(rig.memory, numbered(90), {}, 90);  // the fault is cleared
  EXPECT_EQ(voltage_at(rig, 0.0), 83.0);
}

// A switched inverter takes a new command when a carrier period begins, not in the middle of a pulse.
// Catches: a pattern that changes under way, a delay rounded down.
TEST(Drive, ASwitchedInverterTakesCommandsWithItsCarrier) {
  DriveParameters p = plain_drive(DriveKind::kSwitched);
  p.amplifier.delay_ticks = 0.3;
  p.inverter.pwm_periods_per_tick = 4;
  DriveRig rig(p, Connection::kTwoPhase);
  rig.drive.begin_tick(rig.memory, volts(-60.0, -60.0), {}, 0);
  rig.drive.begin_tick(rig.memory, volts(60.0, 60.0), {}, 1);
  Phases high_s{};
  for (double start_s = 0.0; start_s < kRigTick_s;) {
    const double stop_s = std::min(kRigTick_s, rig.drive.next_edge_s(rig.memory, start_s));
    const std::size_t half = start_s < 0.5 * kRigTick_s - 1e-12 ? 0 : 1;
    if (voltage_at(rig, start_s) > 0.0) high_s[half] += stop_s - start_s;
    start_s = stop_s;
  }
  EXPECT_NEAR(high_s[0], 0.2 * 50e-6, 1e-16);  // two whole periods with the old command
  EXPECT_NEAR(high_s[1], 0.8 * 50e-6, 1e-16);
}

// y = u + (y0 - u) exp(-2 pi f t), through edges, clipping and substeps of any length, to rounding.
// Catches: a filter before the limit, a corner in rad/s, middle or end of the interval off, a state lost
// between intervals.
TEST(Drive, TheOutputFilterIsExact) {
  DriveParameters p = plain_drive();
  p.amplifier.filter_hz = 10e3;
  p.amplifier.delay_ticks = 0.6;
  for (const int substeps : {1, 3, 10}) {
    DriveRig rig(p, Connection::kTwoPhase, {}, substeps);
    const double rate = 2.0 * std::numbers::pi * 10e3;
    rig.tick(volts(0.0, 0.0));
    rig.tick(volts(500.0, -20.0));  // clipped at 100 V; in force for 40 us
    EXPECT_NEAR(rig.memory.filtered_v.a, 100.0 * (1.0 - std::exp(-rate * 40e-6)), 1e-12);
    EXPECT_NEAR(rig.memory.filtered_v.b, -20.0 * (1.0 - std::exp(-rate * 40e-6)), 1e-12);
    EXPECT_EQ(rig.memory.saturated, 1.0);
    rig.drive.begin_tick(rig.memory, volts(0.0), {}, rig.now);
    const double from_v = rig.memory.filtered_v.a;
    const TerminalDrive out = rig.drive.at(rig.memory, 10e-6, 8e-6, {});
    EXPECT_FALSE(out.constant);
    EXPECT_EQ(out.start_v.a, from_v);
    EXPECT_NEAR(out.middle_v.a, 100.0 + (from_v - 100.0) * std::exp(-rate * 4e-6), 1e-12);
    EXPECT_NEAR(out.end_v.a, 100.0 + (from_v - 100.0) * std::exp(-rate * 8e-6), 1e-12);
    // An event may end the interval early.
    rig.drive.finish(rig.memory, 10e-6, 3e-6, out, {}, {}, {});
    EXPECT_NEAR(rig.memory.filtered_v.a, 100.0 + (from_v - 100.0) * std::exp(-rate * 3e-6), 1e-12);
  }
}

// Catches: a filter that goes on by itself while the diodes hold the terminals.
TEST(Drive, WithTheGatesOffTheFilterFollowsTheTerminals) {
  DriveParameters p = plain_drive();
  p.amplifier.filter_hz = 10e3;
  DriveRig rig(p, Connection::kTwoPhase);
  rig.drive.begin_tick(rig.memory, {}, {}, 0);
  const TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-5, {.a = 1.0});
  rig.drive.finish(rig.memory, 0.0, 1e-5, out, {.a = -100.0, .b = 12.0}, {.a = 1.0}, {.a = 0.5});
  EXPECT_EQ(rig.memory.filtered_v.a, -100.0);
  EXPECT_EQ(rig.memory.filtered_v.b, 12.0);
}

// Catches: faults of the wrong phase or rail, of phases that do not exist, a broken wire that a stuck switch
// heals.
TEST(Drive, FaultsHoldTheirTerminal) {
  for (const DriveKind kind : {DriveKind::kVoltage, DriveKind::kAveraged, DriveKind::kSwitched}) {
    DriveRig rig(plain_drive(kind), Connection::kStar);
    const auto with = [&](InjectedFaults faults, const PhaseCommand& command) {
      rig.drive.begin_tick(rig.memory, command, faults, rig.now++);
      return rig.drive.at(rig.memory, 0.0, 1e-6, {});
    };
    const PhaseCommand zero = volts(0.0);
    TerminalDrive out = with({.leg_stuck_high = 2.0}, {});
    EXPECT_EQ(out.mode[0], TerminalMode::kDiodes);
    EXPECT_EQ(out.mode[1], TerminalMode::kDriven);
    EXPECT_EQ(out.start_v.b, 100.0);
    out = with({.leg_stuck_low = 3.0}, zero);
    EXPECT_EQ(out.start_v.c, -100.0);
    EXPECT_EQ(out.mode[0], TerminalMode::kDriven);
    out = with({.leg_stuck_off = 1.0}, zero);
    EXPECT_EQ(out.mode[0], TerminalMode::kDiodes);
    EXPECT_EQ(out.mode[1], TerminalMode::kDriven);
    out = with({.open_phase = 3.0, .leg_stuck_high = 3.0}, zero);
    EXPECT_EQ(out.mode[2], TerminalMode::kOpen);
    EXPECT_EQ(out.mode[1], TerminalMode::kDriven);
    out = with({}, zero);
    EXPECT_EQ(out.mode[2], TerminalMode::kDriven);
  }
  DriveRig two(plain_drive(), Connection::kTwoPhase);
  two.drive.begin_tick(two.memory, volts(1.0, 1.0), {.open_phase = 3.0}, 0);
  EXPECT_EQ(two.drive.at(two.memory, 0.0, 1e-6, {}).mode[2], TerminalMode::kDriven);
}

// Catches: a sag that reaches the rails and not the limit, or stays.
TEST(Drive, ASagLowersRailsAndLimit) {
  DriveRig rig(plain_drive(), Connection::kStar);
  rig.drive.begin_tick(rig.memory, volts(95.0), {.bus_sag = 0.1}, 0);
  TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-6, {});
  EXPECT_EQ(out.rail_v, 90.0);
  EXPECT_EQ(out.start_v.a, 90.0);
  EXPECT_EQ(rig.memory.saturated, 1.0);
  rig.drive.begin_tick(rig.memory, volts(95.0), {}, 1);
  out = rig.drive.at(rig.memory, 0.0, 1e-6, {});
  EXPECT_EQ(out.start_v.a, 95.0);
}

// Catches: a field that needs the gates although it has its supply, a lost field that stays, a field without
// limit.
TEST(Drive, TheFieldHasItsSupplyOrItsCommand) {
  DriveParameters p = plain_drive();
  DriveRig rig(p, Connection::kStar);
  const auto field_v = [&rig](const PhaseCommand& command, const InjectedFaults& faults) {
    rig.drive.begin_tick(rig.memory, command, faults, rig.now++);
    return rig.drive.at(rig.memory, 0.0, 1e-6, {}).field_v;
  };
  EXPECT_EQ(field_v(volts(1.0, 0.0, 0.0, 40.0), {}), 40.0);
  EXPECT_EQ(field_v(volts(1.0, 0.0, 0.0, 400.0), {}), 100.0);
  EXPECT_EQ(rig.memory.saturated, 1.0);
  EXPECT_EQ(field_v({.gates = Gates::kOff, .setpoint = {.field = 40.0}}, {}), 0.0);
  EXPECT_EQ(field_v(volts(1.0, 0.0, 0.0, 40.0), {.field_loss = 1.0}), 0.0);
  p.source.field_v = 220.0;
  rig.drive.set_parameters(p);
  EXPECT_EQ(field_v({}, {}), 220.0);
  EXPECT_EQ(field_v(volts(1.0, 0.0, 0.0, 400.0), {}), 220.0);
  EXPECT_EQ(rig.memory.saturated, 0.0);
  EXPECT_EQ(field_v({}, {.field_loss = 1.0}), 0.0);
  p = plain_drive(DriveKind::kAveraged);
  p.bus.voltage_v = 300.0;
  rig.drive = Drive(p, Connection::kStar, kRigTick_s, 1, 0);
  EXPECT_EQ(field_v(volts(1.0, 0.0, 0.0, 400.0), {}), 300.0);  // a bridge of its own on the whole link
}

// Catches: corruption of every command or of none, beyond full scale, of the gates, by the same noise in each
// phase or tick.
TEST(Drive, CorruptionReplacesSomeSetpointsByNoise) {
  DriveRig rig(plain_drive(), Connection::kIndependent);
  constexpr int kTicks = 20'000;
  int corrupted = 0;
  double sum_a = 0.0;
  double product_ab = 0.0;
  for (Tick tick = 0; tick < kTicks; ++tick) {
    rig.drive.begin_tick(rig.memory, volts(1.0, 2.0, 3.0), {.command_corruption = 0.25}, tick);
    const TerminalDrive out = rig.drive.at(rig.memory, 0.0, 1e-6, {});
    EXPECT_EQ(out.mode[0], TerminalMode::kDriven);
    EXPECT_EQ(rig.memory.saturated, 0.0);
    if (out.start_v.a == 1.0) continue;
    EXPECT_NE(out.start_v.c, 3.0);
    ++corrupted;
    sum_a += out.start_v.a;
    product_ab += out.start_v.a * out.start_v.b;
  }
  EXPECT_NEAR(corrupted, 0.25 * kTicks, 250.0);  // four standard deviations of 61
  // Means over 5000 of numbers with standard deviations of 57.7 V and 57.7^2 V^2: four times 0.82 and 47.
  EXPECT_NEAR(sum_a / corrupted, 0.0, 3.3);
  EXPECT_NEAR(product_ab / corrupted, 0.0, 190.0);
}

// Catches: a trip that a delayed command undoes, or that outlasts its tick by itself.
TEST(Drive, ATripSwitchesOffForTheRestOfTheTick) {
  for (const DriveKind kind :
       {DriveKind::kVoltage, DriveKind::kCurrent, DriveKind::kAveraged, DriveKind::kSwitched}) {
    DriveParameters p = plain_drive(kind);
    p.amplifier.delay_ticks = 1.0;
    DriveRig rig(p, Connection::kStar);
    rig.tick(volts(10.0));
    rig.drive.begin_tick(rig.memory, {}, {}, rig.now++);
    EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).mode[0], TerminalMode::kDriven);
    rig.drive.switch_off(rig.memory);
    EXPECT_EQ(rig.drive.at(rig.memory, 20e-6, 1e-6, {}).mode[0], TerminalMode::kDiodes);
    rig.drive.begin_tick(rig.memory, volts(10.0), {}, rig.now++);
    rig.drive.begin_tick(rig.memory, volts(10.0), {}, rig.now++);
    EXPECT_EQ(rig.drive.at(rig.memory, 0.0, 1e-6, {}).mode[0], TerminalMode::kDriven);
  }
}

DriveParameters with_everything(DriveKind kind) {
  DriveParameters p = plain_drive(kind);
  p.amplifier.delay_ticks = 1.6;
  p.amplifier.filter_hz = kind == DriveKind::kSwitched ? 0.0 : 10e3;
  p.current_loop = {.proportional_v_per_a = 5.0, .integral_v_per_as = 500.0, .limit_a = 5.0};
  p.inverter.dead_time_s = 1e-6;
  p.bus = {.voltage_v = 250.0,
           .resistance_ohm = 0.5,
           .capacitance_f = 1e-4,
           .chopper_on_v = 252.0,
           .chopper_off_v = 251.0,
           .chopper_ohm = 20.0};
  p.source.amplitude_v = 100.0;
  p.source.frequency_hz = 400.0;
  p.source.start_capacitance_f = 1e-4;
  p.source.start_resistance_ohm = 5.0;
  return p;
}

/// The same bytes: the state of a recording is compared so.
bool same_memory(const DriveMemory& x, const DriveMemory& y) {
  return std::memcmp(&x, &y, sizeof(DriveMemory)) == 0;
}

// A new drive with the memory of another goes on as that one would, to the bit.
// Catches: something remembered outside of the memory from one tick to the next.
TEST(Drive, ADriveWithTheMemoryOfAnotherContinuesItsRun) {
  for (const DriveKind kind : {DriveKind::kVoltage, DriveKind::kCurrent, DriveKind::kAveraged,
                               DriveKind::kSwitched, DriveKind::kSource}) {
    const DriveParameters p = with_everything(kind);
    DriveRig rig(p, Connection::kIndependent, {.resistance_ohm = 2.0, .inductance_h = 5e-3});
    const auto command = [kind](Tick tick) {
      const double x = 60.0 * std::sin(0.3 * static_cast<double>(tick));
      return kind == DriveKind::kCurrent && tick % 9 > 2 ? amperes(0.05 * x, 1.0, -0.05 * x)
                                                         : volts(x, -x, 20.0);
    };
    for (Tick tick = 0; tick < 50; ++tick)
      rig.tick(command(tick));
    DriveRig other(p, Connection::kIndependent, rig.load);
    other.memory = rig.memory;
    other.current_a = rig.current_a;
    other.now = rig.now;
    for (Tick tick = 50; tick < 80; ++tick) {
      rig.tick(command(tick));
      other.tick(command(tick));
      EXPECT_TRUE(same_memory(rig.memory, other.memory)) << tick;
      EXPECT_EQ(rig.current_a, other.current_a) << tick;
    }
  }
}

// Asking twice, or for a shorter interval in between, must not change what comes.
// Catches: an at() that moves the state.
TEST(Drive, ReadingAnIntervalTwiceGivesTheSame) {
  for (const DriveKind kind : {DriveKind::kVoltage, DriveKind::kCurrent, DriveKind::kAveraged,
                               DriveKind::kSwitched, DriveKind::kSource}) {
    DriveRig rig(with_everything(kind), Connection::kStar);
    for (int tick = 0; tick < 20; ++tick)
      rig.tick(volts(40.0, -10.0, -30.0));
    rig.drive.begin_tick(rig.memory, volts(40.0), {}, rig.now);
    const PhaseValues current{.a = 1.0, .b = -0.3, .c = -0.7};
    const TerminalDrive first = rig.drive.at(rig.memory, 10e-6, 5e-6, current);
    const DriveMemory memory = rig.memory;
    (void)rig.drive.at(rig.memory, 10e-6, 2e-6, current);
    const TerminalDrive again = rig.drive.at(rig.memory, 10e-6, 5e-6, current);
    EXPECT_TRUE(same_memory(memory, rig.memory));
    EXPECT_EQ(first.mode, again.mode);
    EXPECT_EQ(first.start_v.a, again.start_v.a);
    EXPECT_EQ(first.middle_v.b, again.middle_v.b);
    EXPECT_EQ(first.end_v.c, again.end_v.c);
  }
}

}  // namespace
}  // namespace drivebench::drive_test
