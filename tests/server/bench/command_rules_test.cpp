// Commands that ask for too much, or for it too fast.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/bench/servo_bench.hpp"

namespace drivebench::command_rules_test {
namespace {

constexpr Owner kOwner = 7;

BenchSetup limited_setup(OnExcess on_excess, double slew_per_s) {
  BenchSetup setup = servo_setup();
  setup.axes[0].parameters.drive.amplifier.voltage_limit_v = 40.0;
  setup.axes[0].rules = {.on_excess = on_excess, .slew_per_s = slew_per_s};
  return setup;
}

// Catches: a finite accident (1e308) that passes for a voltage, a limit that refuses itself.
TEST(CommandRules, CMD_11_NumbersBeyondEveryDriveAreRefusedByEveryAxis) {
  for (double PhaseValues::*field :
       {&PhaseValues::a, &PhaseValues::b, &PhaseValues::c, &PhaseValues::field}) {
    Bench bench = owned_bench(servo_setup(), kOwner);
    for (const double bad : {1e308, -1e308, std::nextafter(kMaxSetpoint, 1e9)}) {
      Command command = volts_in_answer_to(bench.tick(), 1.0);
      command.phases.setpoint.*field = bad;
      EXPECT_EQ(bench.submit({.axis = 0, .owner = kOwner, .action = command}), Refused::kBeyondDrive);
    }
    EXPECT_EQ(bench.sample(0).faults, 0u);
    Command most = volts_in_answer_to(bench.tick(), 1.0);
    most.phases.setpoint.*field = -kMaxSetpoint;
    EXPECT_EQ(bench.submit({.axis = 0, .owner = kOwner, .action = most}), Refused::kNot);
  }
}

// Catches: an excess that is limited where it should be refused, a refusal that feeds the watchdog, a limit
// that is not the drive's.
TEST(CommandRules, CMD_13_VoltageBeyondTheLinkIsLimitedOrRefusedAsConfigured) {
  Bench limiting = owned_bench(limited_setup(OnExcess::kSaturate, 0.0), kOwner);
  EXPECT_EQ(submit_volts(limiting, kOwner, 50.0), Refused::kNot);
  limiting.step();
  EXPECT_EQ(limiting.sample(0).u_a_v, 40.0);
  EXPECT_EQ(limiting.sample(0).faults, kVoltageSaturated);

  Bench refusing = owned_bench(limited_setup(OnExcess::kRefuse, 0.0), kOwner);
  EXPECT_EQ(submit_volts(refusing, kOwner, 40.0), Refused::kNot);
  refusing.step();
  EXPECT_EQ(submit_volts(refusing, kOwner, std::nextafter(40.0, 50.0)), Refused::kBeyondDrive);
  refusing.step();
  EXPECT_EQ(refusing.sample(0).u_a_v, 40.0);
  EXPECT_EQ(refusing.sample(0).missed_commands, 1u);
  EXPECT_EQ(refusing.sample(0).faults, 0u);
}

// 8000 V/s are 1 V in a tick of 125 us. Catches: a step that gets through, a limit per second taken for one
// per tick, a flag that stays, a refused step that bars the next command.
TEST(CommandRules, CMD_13_AStepBeyondTheSlewRateIsSlowedOrRefusedAsConfigured) {
  Bench slowing = owned_bench(limited_setup(OnExcess::kSaturate, 8000.0), kOwner);
  for (int i = 1; i <= 4; ++i) {
    EXPECT_EQ(submit_volts(slowing, kOwner, 3.0, -0.5), Refused::kNot);
    slowing.step();
    EXPECT_NEAR(slowing.sample(0).u_a_v, std::min(i, 3), 1e-12);
    EXPECT_EQ(slowing.sample(0).u_b_v, -0.5);
    EXPECT_EQ(slowing.sample(0).faults, i < 3 ? kCommandSlewLimited : 0u);
  }

  Bench refusing = owned_bench(limited_setup(OnExcess::kRefuse, 8000.0), kOwner);
  EXPECT_EQ(submit_volts(refusing, kOwner, 1.5), Refused::kBeyondDrive);
  EXPECT_EQ(submit_volts(refusing, kOwner, 0.9), Refused::kNot);
  step(refusing, 3);  // the command of the first of them holds in the other two
  EXPECT_EQ(submit_volts(refusing, kOwner, 4.5), Refused::kBeyondDrive);
  EXPECT_EQ(submit_volts(refusing, kOwner, 3.8), Refused::kNot) << "three ticks, 3 V";
  refusing.step();
  EXPECT_EQ(refusing.sample(0).u_a_v, 3.8) << "what is taken is not slowed as well";
  EXPECT_EQ(refusing.sample(0).faults, 0u);

  BenchSetup arming = limited_setup(OnExcess::kRefuse, 8000.0);
  arming.arming_commands = 5;
  Bench ramped = owned_bench(arming, kOwner);
  for (int i = 1; i <= 10; ++i) {
    EXPECT_EQ(submit_volts(ramped, kOwner, i), Refused::kNot)
        << "a ramp that begins before the axis is armed";
    ramped.step();
  }
  EXPECT_EQ(ramped.sample(0).u_a_v, 10.0);
}

// The limit counts from what drives the axis, and without a controller that is its safe action. Catches: a
// next controller that asks for 0 V and gets the voltage of the one before; one that gets its whole set-point
// in a tick because the one before had it.
TEST(CommandRules, CMD_13_TheSlewLimitCountsFromTheSafeAction) {
  struct Case {
    SafeAction action;
    double asked_v, got_v;
  };
  for (const Case c : {Case{SafeAction::kFreewheel, 0.0, 0.0}, Case{SafeAction::kFreewheel, 10.0, 1.0},
                       Case{SafeAction::kZeroVoltage, 10.0, 1.0}, Case{SafeAction::kHold, 10.0, 10.0},
                       Case{SafeAction::kHold, 0.0, 9.0}, Case{SafeAction::kQuickStop, 10.0, 6.0}}) {
    BenchSetup setup = limited_setup(OnExcess::kSaturate, 8000.0);
    setup.axes[0].on_link_loss = c.action;
    setup.axes[0].quick_stop_ticks = 10;
    Bench bench = owned_bench(setup, kOwner);
    for (int i = 1; i <= 10; ++i) {
      submit_volts(bench, kOwner, i);
      bench.step();
    }
    submit_lease(bench, LeaseAction::kRelease, kOwner);
    step(bench, 5);
    submit_lease(bench, LeaseAction::kAcquire, kOwner + 1);
    EXPECT_EQ(submit_volts(bench, kOwner + 1, c.asked_v), Refused::kNot);
    bench.step();
    EXPECT_NEAR(bench.sample(0).u_a_v, c.got_v, 1e-12) << static_cast<int>(c.action) << ", " << c.asked_v;
    EXPECT_EQ(bench.sample(0).faults, c.got_v == c.asked_v ? 0u : kCommandSlewLimited);
  }
}

BenchSetup star_setup(OnExcess on_excess, double slew_per_s = 0.0) {
  BenchSetup setup = limited_setup(on_excess, slew_per_s);
  AxisParameters& p = setup.axes[0].parameters;
  induction(p).star = true;
  p.drive.kind = DriveKind::kAveraged;
  return setup;
}

Refused submit_duties(Bench& bench, const PhaseValues& duties) {
  const PhaseCommand phases{.gates = Gates::kDuty, .setpoint = duties};
  return bench.submit(
      {.axis = 0, .owner = kOwner, .action = Command{.answers = bench.tick(), .phases = phases}});
}

// A leg of a star takes 0 to 1, a winding between two legs and the field -1 to 1. Catches: a duty that is
// judged by the volts of the drive, a negative duty of a star's leg that passes, a flag that is missing.
TEST(CommandRules, CMD_13_ADutyBeyondTheRailsIsLimitedOrRefusedAsConfigured) {
  struct Case {
    bool star;
    PhaseValues duties;
    bool beyond;
  };
  for (const Case& c :
       {Case{true, {.a = 0.0, .b = 1.0, .c = 0.5}, false}, Case{true, {.a = -1e-9, .b = 1.0, .c = 0.5}, true},
        Case{true, {.a = 0.0, .b = 0.5, .c = std::nextafter(1.0, 2.0)}, true},
        Case{false, {.a = -1.0, .b = 1.0}, false},
        Case{false, {.a = -1.0, .b = std::nextafter(1.0, 2.0)}, true},
        Case{false, {.a = 0.0, .field = -1.5}, true}}) {
    for (const OnExcess on_excess : {OnExcess::kRefuse, OnExcess::kSaturate}) {
      BenchSetup setup = star_setup(on_excess);
      induction(setup.axes[0].parameters).star = c.star;
      Bench bench = owned_bench(setup, kOwner);
      const bool refused = c.beyond && on_excess == OnExcess::kRefuse;
      EXPECT_EQ(submit_duties(bench, c.duties), refused ? Refused::kBeyondDrive : Refused::kNot);
      bench.step();
      EXPECT_EQ(bench.sample(0).faults, c.beyond && !refused ? kVoltageSaturated : 0u);
    }
  }
}

// 8000 V/s are 1 V in a tick, 1/80 of the link of 80 V. Catches: a step in volts that passes whole for a
// duty, a star whose first duty is compared with 0, a leg's mask that is lost on the way.
TEST(CommandRules, CMD_13_TheSlewLimitOfADutyIsAPartOfTheSupply) {
  Bench bench = owned_bench(star_setup(OnExcess::kSaturate, 8000.0), kOwner);
  EXPECT_EQ(submit_duties(bench, {.a = 0.5 + 0.02, .b = 0.5, .c = 0.5}), Refused::kNot);
  bench.step();
  EXPECT_EQ(bench.sample(0).faults, kCommandSlewLimited);
  EXPECT_NEAR(bench.sample(0).u_a_v, 1.0, 1e-12);
  EXPECT_EQ(bench.sample(0).u_b_v, 0.0);
  Bench refusing = owned_bench(star_setup(OnExcess::kRefuse, 8000.0), kOwner);
  EXPECT_EQ(submit_duties(refusing, {.a = 0.5 + 0.02, .b = 0.5, .c = 0.5}), Refused::kBeyondDrive);
  EXPECT_EQ(submit_duties(refusing, {.a = 0.5 + 0.012, .b = 0.5, .c = 0.5}), Refused::kNot);
  const PhaseCommand before{.gates = Gates::kDuty, .legs_off = 2, .setpoint = {.a = 0.5}};
  PhaseCommand wanted = before;
  wanted.legs_off = 4;
  wanted.setpoint.a = 1.0;
  const PhaseCommand slow = slewed(before, wanted, {.step = 0.125, .connection = Connection::kStar});
  EXPECT_EQ(slow.legs_off, 4u);
  EXPECT_EQ(slow.setpoint.a, 0.625);
}

}  // namespace
}  // namespace drivebench::command_rules_test
