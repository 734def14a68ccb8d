// Frames that the CAN endpoint sends beside the sensors.
#include <gtest/gtest.h>

#include <set>

#include "tests/protocols/can/can_edge.hpp"
#include "tests/server/endpoints/can/can_endpoint_test.hpp"

namespace drivebench::can::can_output_test {
namespace {

// Catches: a bench that is silent at start, or sends another frame before the boot-up.
TEST(CanOutput, TheFirstHeartbeatIsTheBootUp) {
  CanBench bench({}, 2);
  for (const std::uint32_t node : {1u, 2u}) {
    const auto heartbeat = bench.newest(Message::kHeartbeat, node);
    ASSERT_TRUE(heartbeat);
    EXPECT_EQ((*heartbeat)["state"], 0.0);
    EXPECT_EQ((*heartbeat)["profile"], version_of(IdSet::kFree, false));
    EXPECT_EQ((*heartbeat)["period_us"], 125.0);
  }
  bench.received.clear();
  EXPECT_EQ(bench.wait_for(Message::kHeartbeat)["state"], 5.0);
  bench.received.clear();
  bench.endpoint().close();
  bench.settle();
  EXPECT_EQ((*bench.newest(Message::kHeartbeat))["state"], 4.0);
}

// Catches: edges that do not add up to the count, come in the wrong order, or of a tick that is left out.
TEST(CanOutput, TheEdgesAddUpToTheCount) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  std::int64_t count = 0;
  std::uint64_t edges = 0;
  std::uint64_t frames = 0;
  for (int tick = 0; tick < 6000; ++tick) {
    const double angle = 0.12 * tick;  // open loop, 960 rad/s electrical
    const double amplitude = std::min(0.05 * tick, 70.0);
    bench.command(tick, amplitude * std::cos(angle), amplitude * std::sin(angle), lease);
    int last_time = -1;
    double expected_following = 0.0;
    for (const Received& message : bench.received) {
      if (message.row->message != Message::kEdges) continue;
      ++frames;
      ASSERT_EQ(message["tick"], tick);
      ASSERT_EQ(message["start_count"], static_cast<double>(count));
      for (std::size_t i = 0; i < static_cast<std::size_t>(message["edges"]); ++i, ++edges) {
        const Edge edge = edge_at(message.frame, i);
        ASSERT_GE(edge.time, last_time);
        last_time = edge.time;
        count += edge.down ? -1 : 1;
      }
      expected_following = message["following"];
    }
    ASSERT_EQ(expected_following, 0.0) << "the last frame of a tick";
    ASSERT_EQ(count, bench.engine().newest(0).encoder_count) << tick;
  }
  EXPECT_GT(edges, 3000u);
  EXPECT_LT(frames, 6000u) << "a tick without edges sends none";
}

// Catches: an index event that is sent again and again, or without count and tick.
TEST(CanOutput, TheIndexIsSentOnceEachTurn) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  std::set<double> ticks;
  std::size_t messages = 0;
  for (int tick = 0; tick < 6000; ++tick) {
    const double angle = 0.12 * tick;
    const double amplitude = std::min(0.05 * tick, 70.0);
    bench.command(tick, amplitude * std::cos(angle), amplitude * std::sin(angle), lease);
    for (const Received& message : bench.received) {
      if (message.row->message != Message::kIndex) continue;
      ++messages;
      ticks.insert(message["index_tick"]);
      EXPECT_EQ(message["index_count"], static_cast<double>(bench.engine().newest(0).index_count));
      EXPECT_EQ(message["index_tick"], tick);
    }
  }
  EXPECT_GT(ticks.size(), 2u);
  EXPECT_EQ(messages, ticks.size());
}

// Catches: a fault that is not sent, or that is sent at every tick.
TEST(CanOutput, AChangeOfTheFaultWordIsSentOnce) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  bench.command(0, 10.0, 0.0, lease);
  EXPECT_FALSE(bench.newest(Message::kFault));
  bench.command(1, 2000.0, 0.0, lease);
  ASSERT_TRUE(bench.newest(Message::kFault));
  EXPECT_EQ((*bench.newest(Message::kFault))["faults"], static_cast<double>(kVoltageSaturated));
  EXPECT_EQ((*bench.newest(Message::kFault))["tick"], 2.0);
  bench.command(2, 2000.0, 0.0, lease);
  EXPECT_FALSE(bench.newest(Message::kFault));
  bench.command(3, 1.0, 0.0, lease);
  ASSERT_TRUE(bench.newest(Message::kFault));
  EXPECT_EQ((*bench.newest(Message::kFault))["faults"], 0.0);
}

// Catches: state frames at another rate than asked for.
TEST(CanOutput, StateComesAtItsConfiguredInterval) {
  CanBench bench;
  const std::uint8_t lease = bench.acquire();
  int states = 0;
  for (int tick = 0; tick < 40; ++tick) {
    bench.command(tick, 1.0, 0.0, lease);
    states += bench.newest(Message::kState) ? 1 : 0;
  }
  EXPECT_EQ(states, 10);
}

// Catches: a SYNC with a later tick than that of the samples before it, when the bench runs ahead.
TEST(CanOutput, SyncNamesTheTickOfItsSamples) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  config.can.emplace_back();
  config.can.front().sample_every_ticks = 7;
  asio::io_context io(1);
  MemoryWire wire(io);
  const auto listener = wire.connect("listener");
  std::vector<std::array<double, 2>> pairs;  // ticks of sensors and SYNC
  listener->on_frame = [&](const Frame& frame, std::int64_t) {
    const Match found = match(config.can.front().profile, frame);
    const Values values = decode(*found.row, config.can.front().profile, frame);
    if (found.row->message == Message::kSensors) pairs.push_back({values[0], -1.0});
    if (found.row->message == Message::kSync) pairs.back()[1] = values[0];
  };
  Endpoint endpoint(io, config.can.front(), wire.connect("bench"));
  const auto engine = make_threaded_engine(config, nullptr, io, Tick{5000});
  engine->on_end = [&io] { io.stop(); };
  endpoint.serve(*engine);
  io.run();
  io.restart();
  io.poll();
  engine->stop();
  EXPECT_FALSE(pairs.empty());
  for (const auto& [sensors, sync] : pairs)
    EXPECT_EQ(sensors, sync);
}

}  // namespace
}  // namespace drivebench::can::can_output_test
