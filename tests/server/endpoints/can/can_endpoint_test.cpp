// Commands over the CAN endpoint: samples, refusals, frames of the wrong form.
#include "server/endpoints/can/endpoint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>

#include "tests/server/endpoints/can/can_endpoint_test.hpp"

namespace drivebench::can::can_endpoint_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Catches: a tick that does not run, a command that does not reach the phases, a sample that is not what the
// bench says, a SYNC before the samples of its tick.
TEST(CanEndpoint, ACommandEndsItsTickAndTheNextSampleComesBack) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  ASSERT_EQ(lease, 1);
  ASSERT_TRUE(bench.newest(Message::kSensors));
  EXPECT_EQ((*bench.newest(Message::kSensors))["tick"], 0.0);
  for (int tick = 0; tick < 50; ++tick) {
    bench.command(tick, 20.0, -7.5, lease);
    ASSERT_EQ(bench.engine().tick(), tick + 1);
    const Sample& s = bench.engine().newest(0);
    EXPECT_EQ(s.u_a_v, 20.0);
    EXPECT_EQ(s.u_b_v, -7.5);
    const Received sensors = *bench.newest(Message::kSensors);
    EXPECT_EQ(sensors["tick"], tick + 1);
    EXPECT_EQ(sensors["i_a"], static_cast<double>(static_cast<float>(s.i_a_a)));
    EXPECT_EQ(sensors["encoder_count"], static_cast<double>(s.encoder_count));
    EXPECT_EQ(sensors["command_tick"], tick);
    const auto is_no_heartbeat = [](const Received& frame) {
      return frame.row->message != Message::kHeartbeat;  // these come by the wall clock
    };
    const Received& last = *std::find_if(bench.received.rbegin(), bench.received.rend(), is_no_heartbeat);
    EXPECT_EQ(last.row->message, Message::kSync);
    EXPECT_EQ(last["tick"], tick + 1);
    EXPECT_EQ(last["mode"], 1.0);
  }
}

// Catches: a classic frame with other scales than the profile's, or the flags of another tick than the
// count's.
TEST(CanEndpoint, ClassicFramesCarryTheSameSampleInScaledIntegers) {
  CanBench bench(classic());
  const std::uint8_t lease = bench.acquire();
  for (int tick = 0; tick < 200; ++tick)
    bench.command(tick, 20.0, -7.5, lease);
  const Sample& s = bench.engine().newest(0);
  EXPECT_EQ(s.u_a_v, 20.0);
  const Received currents = *bench.newest(Message::kCurrents);
  const Received encoder = *bench.newest(Message::kEncoder);
  EXPECT_NEAR(currents["i_a"], s.i_a_a, 0.5e-3) << "half a count";
  EXPECT_NEAR(currents["i_b"], s.i_b_a, 0.5e-3);
  EXPECT_EQ(currents["tick"], 200.0);
  EXPECT_EQ(currents["encoder_levels"], static_cast<double>(s.encoder_levels));
  EXPECT_EQ(encoder["encoder_count"], static_cast<double>(s.encoder_count));
  EXPECT_NEAR(encoder["edge_age"], s.edge_age_s, 0.5e-6);
  ASSERT_TRUE(bench.newest(Message::kState));
  EXPECT_EQ((*bench.newest(Message::kState))["bus_voltage"], s.bus_voltage_v);
}

// CMD-11, CMD-06, CMD-07. Catches: a refusal without its reason, or one that the bench does not count.
TEST(CanEndpoint, EveryRefusedCommandGetsAReasonAndIsCounted) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  const auto refused = [&] { return bench.engine().newest(0).refused_commands; };
  bench.command(0, 1.0, 1.0, lease);
  const std::uint64_t before = refused();
  const auto expect = [&](Result why, double answers, double u_a, std::uint8_t with, double mode) {
    bench.command(answers, u_a, 0.0, with, mode);
    EXPECT_EQ(bench.result(), static_cast<double>(why)) << answers << ' ' << u_a << ' ' << mode;
    EXPECT_EQ(bench.engine().tick(), 1);
  };
  expect(Result::kNotOwner, 1, 1.0, static_cast<std::uint8_t>(lease + 1), 1.0);
  expect(Result::kNotOwner, 1, 1.0, 0, 1.0);
  expect(Result::kNotFinite, 1, kNan, lease, 1.0);
  expect(Result::kNotFinite, 1, std::numeric_limits<double>::infinity(), lease, 1.0);
  expect(Result::kStale, 0, 1.0, lease, 1.0);  // a duplicate
  expect(Result::kStale, 2, 1.0, lease, 1.0);  // of the future
  expect(Result::kMalformed, 1, 1.0, lease, 6.0);
  expect(Result::kWrongDrive, 1, 1.0, lease, 4.0);  // currents for a voltage amplifier
  bench.command(1, 2.0, 0.0, lease);
  EXPECT_EQ(bench.engine().tick(), 2);
  EXPECT_EQ(refused() - before, 6u) << "those with the lease";
  EXPECT_EQ(bench.count("refused"), 8u);
  EXPECT_EQ(bench.count("not_owner"), 2u);
}

// Catches: duties taken as volts, in either variant; a duty beyond 1 that is not clipped by the amplifier.
TEST(CanEndpoint, DutiesAreSharesOfTheBusVoltage) {
  CanBench fd;
  const std::uint8_t lease = fd.acquire();
  fd.command(0, 0.5, -0.25, lease, 3.0);
  const double bus_v = fd.engine().newest(0).bus_voltage_v;
  EXPECT_EQ(fd.engine().newest(0).u_a_v, 0.5 * bus_v);
  EXPECT_EQ(fd.engine().newest(0).u_b_v, -0.25 * bus_v);
  fd.command(1, 1.5, 0.0, lease, 3.0);
  EXPECT_EQ(fd.engine().newest(0).u_a_v, bus_v);

  CanBench with_integers(classic());
  const std::uint8_t other = with_integers.acquire();
  with_integers.command(0, 1.0, -16384.0 / 32767.0, other, 3.0);
  EXPECT_NEAR(with_integers.engine().newest(0).u_a_v, bus_v, 1e-9 * bus_v);
  EXPECT_NEAR(with_integers.engine().newest(0).u_b_v, -bus_v * 16384 / 32767, 1e-9 * bus_v);
}

// Catches: a frame of the wrong form taken for a command, or not counted by its kind.
TEST(CanEndpoint, CAN_09_FramesOfTheWrongFormAreCountedByKind) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  const MessageRow& row = *find_message(Message::kCommand, true);
  const Frame good =
      encode(row, bench.profile(), 1, std::array{0.0, 1.0, 1.0, 1.0, 0.0, static_cast<double>(lease)});
  Frame frame = good;
  frame.size = 12;
  bench.send(frame);
  EXPECT_EQ(bench.count("wrong_size"), 1u);
  frame = good;
  frame.extended = true;
  bench.send(frame);
  EXPECT_EQ(bench.count("wrong_format"), 1u);
  frame = good;
  frame.fd = frame.bit_rate_switch = false;
  frame.remote = true;
  frame.size = 0;
  bench.send(frame);
  EXPECT_EQ(bench.count("remote"), 1u);
  frame = good;
  frame.data[15] = 1;
  bench.send(frame);
  EXPECT_EQ(bench.count("reserved"), 1u);
  frame = good;
  frame.id = 0x7DF;
  bench.send(frame);
  EXPECT_EQ(bench.engine().tick(), 0);
  bench.send(good);
  EXPECT_EQ(bench.engine().tick(), 1);
}

// Catches: an FD frame that a classic bench obeys.
TEST(CanEndpoint, CAN_09_AClassicBenchObeysNoFdFrame) {
  CanBench bench(classic());
  const std::uint8_t lease = bench.acquire();
  Frame frame = encode(*find_message(Message::kCommand, false), bench.profile(), 1,
                       std::array{1.0, 1.0, 0.0, 1.0, 0.0, static_cast<double>(lease)});
  frame.fd = true;
  bench.send(frame);
  EXPECT_EQ(bench.count("wrong_kind"), 1u);
  EXPECT_EQ(bench.engine().tick(), 0);
}

// Catches: an axis whose tick another axis' controller ends; node ids mixed up.
TEST(CanEndpoint, TwoAxesWaitForEachOther) {
  CanBench bench({}, 2);
  const std::uint8_t first = bench.acquire(1, 1);
  const std::uint8_t second = bench.acquire(1, 2);
  (void)second;
  ASSERT_NE(first, 0);
  bench.command(0, 1.0, 0.0, first, 1.0, 1);
  EXPECT_EQ(bench.engine().tick(), 0);
  bench.request(Request::kRelease, 1, 1, 2);
  EXPECT_EQ(bench.engine().tick(), 1) << "the controller that the tick waited for has left";
}

// Catches: malformed commands of another controller that end the owner's row of good commands, or bar its
// clear.
TEST(CanEndpoint, AMalformedCommandOfAnotherControllerDoesNotCountForTheOwner) {
  BenchConfig config = servo_bench();
  config.setup.arming_commands = 3;
  config.setup.axes[0].parameters.drive.amplifier.over_current_a = 0.5;
  config.setup.axes[0].parameters.drive.amplifier.over_current_trip = true;
  config.can.emplace_back();
  CanBench bench(config);
  const std::uint8_t lease = bench.acquire();
  const auto tick = [&] { return static_cast<double>(bench.engine().tick()); };
  const auto send_malformed = [&](std::uint8_t with) {
    bench.command(tick(), 0.0, 0.0, with, 9.0);
    EXPECT_EQ(bench.result(), static_cast<double>(Result::kMalformed));
  };
  for (int i = 0; i < 3; ++i) {
    send_malformed(0);
    bench.command(tick(), 60.0, 0.0, lease);
  }
  EXPECT_EQ(bench.engine().newest(0).state, static_cast<std::uint64_t>(ControlState::kRun));
  EXPECT_EQ(bench.engine().newest(0).refused_commands, 0u);
  EXPECT_EQ(bench.count("refused"), 3u);
  while (bench.result() != static_cast<double>(Result::kLatched) && tick() < 1000)
    bench.command(tick(), 60.0, 0.0, lease);
  ASSERT_EQ(bench.result(), static_cast<double>(Result::kLatched));
  send_malformed(lease);
  bench.request(Request::kClearFaults, lease);
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kCauseLasts)) << "the owner's own is";
  bench.command(tick(), 0.0, 0.0, lease, 0.0);
  send_malformed(static_cast<std::uint8_t>(lease + 1));
  bench.request(Request::kClearFaults, lease);
  EXPECT_EQ(bench.result(), 0.0);
}

// Catches: a bench that does not come back with its link.
TEST(CanEndpoint, CAN_02_CAN_03_ALinkThatComesBackIsUsedAgain) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  bench.wire().set_link(BusState::kDown);
  bench.settle();
  EXPECT_EQ(bench.endpoint().report().state, "CAN_DOWN");
  bench.wire().set_link(BusState::kUp);
  bench.settle();
  EXPECT_EQ(bench.endpoint().report().state, "up");
  bench.command(0, 3.0, 0.0, lease);
  EXPECT_EQ(bench.engine().newest(0).u_a_v, 3.0);
}

}  // namespace
}  // namespace drivebench::can::can_endpoint_test
