// Frames from elsewhere: other benches with the same identifiers, and CANopen devices on the same bus.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <vector>

#include "tests/protocols/can/can_sample.hpp"
#include "tests/server/endpoints/can/can_endpoint_test.hpp"
#include "tests/server/endpoints/simulated_clock.hpp"

namespace drivebench::can::can_conflict_test {
namespace {

using namespace std::chrono_literals;

/// A bench on a bus in memory, in simulated time.
class ConflictTest : public testing::Test {
 protected:
  static void pass(CanBench& bench, ServerClock::duration time, SimulatedClock& clock) {
    for (ServerClock::duration passed{}; passed < time; passed += 10ms) {
      clock.pass(bench.io(), 10ms);
      bench.settle();
    }
  }
  void pass(CanBench& bench, ServerClock::duration time) { pass(bench, time, clock_); }

  /// A sample as another bench sends it.
  static void disturb(CanBench& bench, std::uint32_t node = 1) {
    bench.send(encode_sample(*find_message(Message::kSensors, true), bench.profile(), node, Sample{}));
  }
  static std::string state(CanBench& bench) { return bench.endpoint().report().state; }

  SimulatedClock clock_;
};

// Catches: a stray frame that silences a bench for good or ends a run; a bench that does not tell.
TEST_F(ConflictTest, CAN_11_AfterAStrayFrameTheAxisPausesAndGoesOn) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  bench.command(0, 1.0, 0.0, lease);
  testing::internal::CaptureStderr();
  bench.received.clear();
  disturb(bench);
  EXPECT_NE(
      testing::internal::GetCapturedStderr().find("ID_CONFLICT: a frame with identifier 0x61 of this bench "
                                                  "came from elsewhere; axis 0 is silent for 1 s"),
      std::string::npos);
  EXPECT_EQ(state(bench), "ID_CONFLICT");
  EXPECT_EQ(bench.count("conflicts"), 1u);
  ASSERT_EQ(bench.received.size(), 1u) << "so that another bench notices as well";
  EXPECT_EQ((*bench.newest(Message::kHeartbeat))["state"], 5.0) << "it has not stopped";

  bench.command(1, 2.0, 0.0, lease);
  EXPECT_EQ(bench.engine().newest(0).u_a_v, 2.0) << "commands count during the pause";
  pass(bench, 980ms);
  EXPECT_EQ(bench.newest(Message::kSensors), std::nullopt);
  pass(bench, 30ms);
  ASSERT_TRUE(bench.newest(Message::kSensors)) << "in lockstep the controller waits for it";
  EXPECT_EQ((*bench.newest(Message::kSensors))["tick"], 2.0);
  EXPECT_EQ((*bench.newest(Message::kSync))["tick"], 2.0);
  EXPECT_EQ((*bench.newest(Message::kHeartbeat))["lease"], lease);
  bench.command(2, 3.0, 0.0, lease);
  EXPECT_EQ((*bench.newest(Message::kSensors))["tick"], 3.0);
  EXPECT_EQ(state(bench), "ID_CONFLICT") << "it may not be over";
  for (int i = 0; i < 10; ++i) {  // or the controller is silent for too long
    pass(bench, 1s);
    bench.request(Request::kRenew, lease);
  }
  EXPECT_EQ(state(bench), "up");
  EXPECT_EQ(bench.count("conflicts"), 1u);
}

// Catches: frames that come again and again and keep a bench silent for good, or for a time that grows
// without a limit; one that goes on with a controller that hears two benches.
TEST_F(ConflictTest, CAN_11_FramesThatComeAgainMakeLongerPausesThatEnd) {
  CanBench bench;
  ASSERT_NE(bench.acquire(), 0);
  const auto pause_of = [&] {
    bench.received.clear();
    ServerClock::duration length{};
    do {
      disturb(bench);  // many during the pause, too
      bench.received.clear();
      pass(bench, 100ms);
      length += 100ms;
    } while (bench.received.empty() && length < 60s);
    return length;
  };
  EXPECT_EQ(pause_of(), 1s);
  EXPECT_NE(bench.engine().owner(0), 0u);
  std::vector<ServerClock::duration> pauses;
  for (int i = 0; i < 5; ++i)
    pauses.push_back(pause_of());
  EXPECT_EQ(pauses, (std::vector<ServerClock::duration>{2s, 4s, 8s, 10s, 10s}));
  EXPECT_EQ(bench.engine().owner(0), 0u) << "another bench answers its controller";
  EXPECT_EQ(state(bench), "ID_CONFLICT");

  disturb(bench);
  const Owner before = bench.engine().new_owner({});
  EXPECT_EQ(bench.acquire(), 0);
  EXPECT_EQ(bench.engine().new_owner({}), before + 1) << "the bench was asked for the axis all the same";
  pass(bench, 21s);
  EXPECT_EQ(state(bench), "up");
  EXPECT_NE(bench.acquire(), 0);
  EXPECT_EQ(pause_of(), 1s) << "a new conflict begins from the start";
}

// Catches: an axis that is silent because another one has a conflict; SYNC that two benches send.
TEST_F(ConflictTest, CAN_11_OnlyTheAxisOfTheIdentifierPauses) {
  CanBench bench(Profile{}, 2);
  const auto heard = [&](std::uint32_t node) {
    bench.received.clear();
    pass(bench, 50ms);
    return bench.newest(Message::kHeartbeat, node).has_value();
  };
  disturb(bench, 2);
  EXPECT_TRUE(heard(1));
  EXPECT_FALSE(heard(2));
  EXPECT_NE(bench.acquire(77, 1), 0);
  EXPECT_TRUE(bench.newest(Message::kSync));
  bench.send(encode(*find_message(Message::kSync, true), bench.profile(), 0, std::array{7.0, 0.0}));
  EXPECT_FALSE(heard(1));
  pass(bench, 1s);
  EXPECT_TRUE(heard(1) && heard(2));
}

// Catches: two benches with the same nodes that do not both notice, that forget it while it lasts, or that
// fill the bus with answers to each other.
TEST_F(ConflictTest, CAN_11_TwoBenchesWithTheSameNodeTellItAsLongAsItLasts) {
  CanBench bench;
  ASSERT_NE(bench.acquire(), 0);
  pass(bench, 1s);
  BenchConfig config = on_bus(servo_bench(), Profile{});
  auto engine = make_lockstep_engine(config);
  Endpoint other(bench.io(), config.can.front(), bench.wire().connect("other"));
  other.serve(*engine);
  pass(bench, 5s);
  EXPECT_EQ(bench.engine().owner(0), 0u);
  bench.received.clear();
  for (int i = 0; i < 60; ++i) {
    pass(bench, 1s);
    EXPECT_EQ(state(bench), "ID_CONFLICT") << i;
    EXPECT_EQ(other.report().state, "ID_CONFLICT") << i;
  }
  EXPECT_LE(bench.received.size(), 60u) << "a few for each pause; without the pauses 12,000";
  other.close();
  bench.settle();
  pass(bench, 25s);
  EXPECT_EQ(state(bench), "up");
}

/// The frames with which a CANopen tool finds its devices: NMT to all, guarding, an SDO upload of object
/// 0x1000 from every node, and what devices answer.
std::vector<Frame> canopen_scan() {
  std::vector<Frame> frames = {{.id = 0x000, .size = 2, .data = {0x82, 0}},
                               {.id = 0x080, .size = 0},
                               {.id = 0x080, .size = 1, .data = {1}},
                               {.id = 0x100, .size = 6},
                               {.id = 0x7E5, .size = 8, .data = {4, 1}}};
  for (std::uint32_t node = 1; node <= 127; ++node) {
    frames.push_back({.id = 0x700 + node, .remote = true, .size = 1});
    frames.push_back({.id = 0x600 + node, .size = 8, .data = {0x40, 0x00, 0x10}});
    frames.push_back({.id = 0x580 + node, .size = 8, .data = {0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02}});
    frames.push_back({.id = 0x700 + node, .size = 1, .data = {5}});
    frames.push_back({.id = 0x080 + node, .size = 8, .data = {0x10, 0x81, 0x11}});
    for (std::uint32_t process_data = 0x180; process_data <= 0x500; process_data += 0x080)
      frames.push_back({.id = process_data + node, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}});
  }
  return frames;
}

/// A bench with classic frames whose axis has Hall lines and so all messages.
BenchConfig wide_bench(IdSet ids) {
  BenchConfig config = on_bus(servo_bench(), with_ids(ids, classic()));
  config.setup.axes[0].parameters.sensors.hall.enabled = true;
  return config;
}

// Catches: default identifiers that a node scan of CANopen meets.
TEST_F(ConflictTest, CAN_15_ANodeScanOfCanopenDisturbsNothing) {
  for (const BenchConfig& config :
       {wide_bench(IdSet::kFree), on_bus(servo_bench(), classic()), on_bus(servo_bench(), Profile{})}) {
    CanBench bench(config);
    const std::uint8_t lease = bench.acquire();
    bench.command(0, 1.0, 0.0, lease);
    const TransportReport before = bench.endpoint().report();
    for (const Frame& frame : canopen_scan())
      bench.send(frame);
    EXPECT_EQ(bench.endpoint().report().counts, before.counts) << "not even a frame that is refused";
    EXPECT_EQ(state(bench), "up");
    bench.command(1, 2.0, 0.0, lease);
    EXPECT_EQ(bench.engine().tick(), 2);
    EXPECT_EQ(bench.engine().newest(0).u_a_v, 2.0);
  }
}

// Catches: a bench with the identifiers of CANopen that a node scan silences for good.
TEST_F(ConflictTest, CAN_15_WithTheIdentifiersOfCanopenAScanIsAPause) {
  CanBench bench(wide_bench(IdSet::kCanopen));
  const std::uint8_t lease = bench.acquire();
  EXPECT_EQ((*bench.newest(Message::kReply)).frame.id, 0x381u);
  bench.command(0, 1.0, 0.0, lease);
  bench.send({.id = 0x601, .size = 8, .data = {0x40, 0x00, 0x10}});
  EXPECT_EQ(state(bench), "ID_CONFLICT");
  EXPECT_EQ(bench.count("conflicts"), 1u);
  pass(bench, 1s + 10ms);
  EXPECT_TRUE(bench.newest(Message::kPhases));
  bench.command(1, 2.0, 0.0, lease);
  EXPECT_EQ((*bench.newest(Message::kCurrents))["tick"], 2.0);
}

}  // namespace
}  // namespace drivebench::can::can_conflict_test
