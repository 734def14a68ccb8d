// Axes with a phase c, a field winding, Hall lines or a tachometer on the CAN endpoint.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>

#include "plant/injected_faults.hpp"
#include "tests/server/endpoints/can/can_endpoint_test.hpp"

namespace drivebench::can::can_wide_test {
namespace {

Profile profile_of(bool fd) {
  Profile profile;
  profile.fd = fd;
  return profile;
}

/// The servo motor, wound in an isolated star and with Hall lines.
BenchConfig star_bench(DriveKind drive = DriveKind::kVoltage) {
  BenchConfig bench = servo_bench();
  AxisParameters& p = bench.setup.axes[0].parameters;
  induction(p).star = true;
  p.sensors.hall.enabled = true;
  p.drive.kind = drive;
  p.drive.current_loop = {.proportional_v_per_a = 20.0, .limit_a = 100.0};
  bench.setup.substeps = 10;
  return bench;
}

/// A DC motor whose field has terminals of its own, with a tachometer.
BenchConfig separate_bench() {
  BenchConfig bench = servo_bench();
  AxisParameters& p = bench.setup.axes[0].parameters;
  p.machine = SeparateDcMachineParameters{.armature_resistance_ohm = 1.0,
                                          .armature_inductance_h = 0.01,
                                          .motor_constant = 0.5,
                                          .field_resistance_ohm = 10.0,
                                          .field_inductance_h = 0.1};
  p.sensors.tachometer.analog.enabled = true;
  p.sensors.tachometer.gain_vs_per_rad = 0.05;
  return bench;
}

class WideAxis : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Profiles, WideAxis, testing::Bool(),
                         [](const auto& fd) { return fd.param ? "Fd" : "Classic"; });

// Catches: a phase c that does not reach the machine or does not come back; Hall lines that are lost.
TEST_P(WideAxis, PhaseCIsCommandedAndReported) {
  CanBench bench(on_bus(star_bench(), profile_of(GetParam())));
  const std::uint8_t lease = bench.acquire();
  ASSERT_NE(lease, 0);
  for (unsigned tick = 0; tick < 400; ++tick) {
    const double angle = 0.1 * tick;
    const auto u = [&](double behind) { return std::round(3000.0 * std::cos(angle - behind)) * 0.01; };
    const double third = 2.0943951023931953;
    bench.command({.tick = tick, .mode = 1, .lease = lease, .a = u(0), .b = u(third), .c = u(2 * third)});
    const Sample& s = bench.engine().newest(0);
    ASSERT_EQ(bench.engine().tick(), tick + 1);
    ASSERT_NEAR(s.u_c_v, u(2 * third), 1e-5) << "a single at most";
    const Received sensors = *bench.newest(GetParam() ? Message::kSensors : Message::kPhases);
    ASSERT_NEAR(sensors["i_c"], s.i_c_a, 0.5001e-3) << "half a count";
    ASSERT_EQ(sensors["hall_lines"], static_cast<double>(s.hall_lines));
    ASSERT_EQ(std::fmod(sensors["tick"], 65536.0), tick + 1);
  }
  const Sample& s = bench.engine().newest(0);
  EXPECT_GT(std::abs(s.encoder_count), 100);
  EXPECT_NEAR(s.true_i_a_a + s.true_i_b_a + s.true_i_c_a, 0.0, 1e-9) << "an isolated star";
}

// Catches: half of a command that is taken for the whole, in either variant; a refusal that the bench does
// not count; a command without set-points that is held up for them.
TEST_P(WideAxis, ACommandWithoutPhaseCIsIncomplete) {
  CanBench bench(on_bus(star_bench(), profile_of(GetParam())));
  const std::uint8_t lease = bench.acquire();
  const bool fd = GetParam();
  const MessageRow& narrow = *find_message(Message::kCommand, fd);
  const auto send_half = [&](unsigned tick, unsigned mode, std::uint8_t with) {
    Values values{};
    values[index_of(narrow, "tick")] = tick;
    values[index_of(narrow, "mode")] = mode;
    values[index_of(narrow, "lease")] = with;
    values[index_of(narrow, "u_a")] = 5.0;
    bench.received.clear();
    bench.send(encode(narrow, bench.profile(), 1, values));
  };
  send_half(0, 1, lease);
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kIncomplete));
  send_half(0, 3, lease);
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kIncomplete));
  send_half(0, 1, static_cast<std::uint8_t>(lease + 1));
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kNotOwner)) << "this is judged first";
  EXPECT_EQ(bench.engine().tick(), 0);
  send_half(0, 0, lease);
  EXPECT_EQ(bench.result(), -1.0);
  send_half(1, 2, lease);
  EXPECT_EQ(bench.result(), -1.0);
  EXPECT_EQ(bench.engine().tick(), 2);
  EXPECT_EQ(bench.engine().newest(0).refused_commands, 2u);
}

// Catches: set-points of another tick, mode or controller, or of one that is gone, that are put together with
// a command.
TEST(ClassicWideAxis, SetpointsAreKeptForTheirCommandAlone) {
  CanBench bench(on_bus(star_bench(), classic()));
  std::uint8_t lease = bench.acquire();
  const auto phases = [&](double tick, double mode, double with, double u_c) {
    bench.send(Message::kPhaseCommand, std::array{u_c, 0.0, tick, mode, with});
  };
  const auto main = [&](double tick, double mode, double with) {
    bench.received.clear();
    bench.send(Message::kCommand, std::array{1.0, 2.0, tick, mode, 0.0, with});
  };
  constexpr auto kIncomplete = static_cast<double>(Result::kIncomplete);
  phases(1, 1, lease, 7.0);
  main(0, 1, lease);
  EXPECT_EQ(bench.result(), kIncomplete) << "of the next tick";
  phases(0, 3, lease, 7.0);
  main(0, 1, lease);
  EXPECT_EQ(bench.result(), kIncomplete) << "duties";
  phases(0, 1, lease + 1.0, 7.0);
  main(0, 1, lease);
  EXPECT_EQ(bench.result(), kIncomplete) << "of another controller";
  phases(0, 1, lease, 7.0);
  phases(0, 1, lease + 1.0, 9.0);
  main(0, 1, lease);
  EXPECT_EQ(bench.engine().newest(0).u_c_v, 7.0);
  main(1, 1, lease);
  EXPECT_EQ(bench.result(), kIncomplete) << "set-points serve one command";
  phases(1, 1, lease, 7.0);
  bench.request(Request::kRelease, lease);
  lease = bench.acquire(78);
  main(1, 1, lease);
  EXPECT_EQ(bench.result(), kIncomplete) << "of the controller before";
}

// Catches: a leg of a star whose duty is taken across the whole link.
TEST_P(WideAxis, ADutyIsOfTheHalfLinkInAStar) {
  CanBench bench(on_bus(star_bench(), profile_of(GetParam())));
  const std::uint8_t lease = bench.acquire();
  const double bus_v = bench.engine().newest(0).bus_voltage_v;
  ASSERT_GT(bus_v, 0.0);
  bench.command({.tick = 0, .mode = kDutyMode, .lease = lease, .a = 0.5, .b = -0.25, .c = 0.125});
  const Sample& s = bench.engine().newest(0);
  EXPECT_NEAR(s.u_a_v, 0.25 * bus_v, kDutyUnit * bus_v);
  EXPECT_NEAR(s.u_b_v, -0.125 * bus_v, kDutyUnit * bus_v);
  EXPECT_NEAR(s.u_c_v, 0.0625 * bus_v, kDutyUnit * bus_v);
}

// Catches: duties of legs that count from the middle of the link; legs that are off in another order, or only
// in the frames of phase c; a mask of legs that do not exist.
TEST_P(WideAxis, InModeFiveLegsHaveDutiesAndCanBeOff) {
  CanBench bench(on_bus(star_bench(DriveKind::kAveraged), profile_of(GetParam())));
  const std::uint8_t lease = bench.acquire();
  const double bus_v = bench.engine().newest(0).bus_voltage_v;
  bench.command({.tick = 0, .mode = kLegDutyMode, .lease = lease, .a = 1.0, .b = 0.25, .c = 0.0});
  const Sample& s = bench.engine().newest(0);
  EXPECT_NEAR(s.u_a_v, 0.5 * bus_v, 1e-9);
  EXPECT_NEAR(s.u_b_v, -0.25 * bus_v, kDutyUnit * bus_v);
  EXPECT_NEAR(s.u_c_v, -0.5 * bus_v, 1e-9);
  for (std::uint64_t tick = 1; tick < 100; ++tick) {
    bench.command({.tick = tick, .mode = kLegDutyMode, .lease = lease, .legs_off = 2, .a = 0.6, .c = 0.5});
  }
  EXPECT_EQ(bench.engine().newest(0).true_i_b_a, 0.0);
  EXPECT_NE(bench.engine().newest(0).true_i_a_a, 0.0);
  bench.command({.tick = 100, .mode = kLegDutyMode, .lease = lease, .legs_off = 8});
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kMalformed));
}

// CMD-11. Catches: currents that are taken for voltages, or a phase that the current loop does not get; a
// current that is no number and not refused.
TEST_P(WideAxis, InModeFourTheCurrentsFollow) {
  CanBench bench(on_bus(star_bench(DriveKind::kCurrent), profile_of(GetParam())));
  const std::uint8_t lease = bench.acquire();
  for (unsigned tick = 0; tick < 200; ++tick) {
    bench.command({.tick = tick, .mode = kCurrentMode, .lease = lease, .a = 1.0, .b = 0.5, .c = -1.5});
    ASSERT_EQ(bench.engine().tick(), tick + 1);
  }
  const Sample& s = bench.engine().newest(0);
  EXPECT_NEAR(s.true_i_a_a, 1.0, 0.1) << "of a proportional loop";
  EXPECT_NEAR(s.true_i_b_a, 0.5, 0.1);
  EXPECT_NEAR(s.true_i_c_a, -1.5, 0.15);
  if (GetParam()) {  // classic frames have integers
    for (double CommandFields::*current : {&CommandFields::a, &CommandFields::b, &CommandFields::c}) {
      for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL, 1e38}) {
        CommandFields fields{
            .tick = 200, .mode = kCurrentMode, .lease = lease, .a = 1.0, .b = 0.5, .c = -1.5};
        fields.*current = bad;
        bench.command(fields);
        EXPECT_EQ(bench.result(),
                  static_cast<double>(std::isfinite(bad) ? Result::kBeyondDrive : Result::kNotFinite));
      }
    }
    EXPECT_EQ(bench.engine().tick(), 200);
    EXPECT_EQ(bench.engine().newest(0).refused_commands, 0u) << "the tick that shows them is to come";
  }
  CanBench voltages(on_bus(star_bench(), profile_of(GetParam())));
  voltages.command({.tick = 0, .mode = kCurrentMode, .lease = voltages.acquire()});
  EXPECT_EQ(voltages.result(), static_cast<double>(Result::kWrongDrive));
}

// Catches: a field that gets the voltage of a phase, its current sent as another's, a tachometer without
// frames.
TEST_P(WideAxis, TheFieldAndTheTachometerHaveTheirPlaces) {
  CanBench bench(on_bus(separate_bench(), profile_of(GetParam())));
  const std::uint8_t lease = bench.acquire();
  for (unsigned tick = 0; tick < 400; ++tick)
    bench.command({.tick = tick, .mode = 1, .lease = lease, .a = 24.0, .field = 20.0});
  const Sample& s = bench.engine().newest(0);
  EXPECT_EQ(s.u_f_v, 20.0);
  EXPECT_GT(s.i_f_a, 1.5);
  EXPECT_GT(s.tachometer_v, 0.05);
  const bool fd = GetParam();
  EXPECT_NEAR((*bench.newest(fd ? Message::kSensors : Message::kPhases))["i_f"], s.i_f_a, 0.5001e-3);
  EXPECT_NEAR((*bench.newest(fd ? Message::kSensors : Message::kDetails))["tachometer"], s.tachometer_v,
              0.5001e-2);
}

// Catches: details at another rate than the state's, an injected fault that is not sent, a
// wide axis that its heartbeat does not tell from a narrow one.
TEST_P(WideAxis, DetailsComeWithTheStateAndWithAnInjectedFault) {
  CanBench bench(on_bus(star_bench(), profile_of(GetParam())));
  EXPECT_EQ((*bench.newest(Message::kHeartbeat))["profile"], version_of(IdSet::kFree, true));
  const std::uint8_t lease = bench.acquire();
  int details = 0;
  for (unsigned tick = 0; tick < 40; ++tick) {
    bench.command({.tick = tick, .mode = 1, .lease = lease, .a = 3.0});
    for (const Received& message : bench.received)
      details += message.row->message == Message::kDetails ? 1 : 0;
  }
  EXPECT_EQ(details, GetParam() ? 10 : 30);
  const std::size_t row = find_injectable_fault("hall_offset");
  bench.engine().request(
      {.tick = 0, .axis = 0, .owner = 0, .action = InjectFault{static_cast<std::uint32_t>(row), 0.5}},
      [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kNot); });
  bench.command({.tick = 40, .mode = 1, .lease = lease, .a = 3.0});
  ASSERT_TRUE(bench.newest(Message::kDetails));
  EXPECT_EQ((*bench.newest(Message::kDetails))["injected"], std::exp2(static_cast<double>(row)));
}

// Catches: an axis that is given other frames because its neighbour is wide, or that obeys its neighbour's.
TEST_P(WideAxis, ANarrowAxisKeepsItsFramesBesideAWideOne) {
  BenchConfig config = servo_bench(2);
  config.setup.axes[1].parameters = star_bench().setup.axes[0].parameters;
  CanBench bench(on_bus(config, profile_of(GetParam())));
  EXPECT_EQ((*bench.newest(Message::kHeartbeat, 1))["profile"], version_of(IdSet::kFree, false));
  const std::uint8_t lease = bench.acquire();
  const bool fd = GetParam();
  const MessageRow& wide = *find_message(fd ? Message::kCommand : Message::kPhaseCommand, fd, true);
  Values values{};
  values[index_of(wide, "lease")] = lease;
  values[index_of(wide, "mode")] = 1;
  bench.send(encode(wide, bench.profile(), 1, values));
  EXPECT_EQ(bench.engine().tick(), 0);
  EXPECT_EQ(bench.count("wrong_size"), fd ? 1u : 0u) << "a classic bench does not listen to that identifier";
  bench.command(0, 20.0, -7.5, lease);
  EXPECT_EQ(bench.engine().tick(), 1);
  EXPECT_EQ(bench.engine().newest(0).u_b_v, -7.5);
  for (const Received& message : bench.received) {
    EXPECT_FALSE(message.node == 1 && message.row->width == Width::kWide) << message.row->name;
  }
  EXPECT_TRUE(bench.newest(fd ? Message::kSensors : Message::kPhases, 2));
}

}  // namespace
}  // namespace drivebench::can::can_wide_test
