#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

#include "server/endpoints/can/buses/backends.hpp"
#include "server/endpoints/can/buses/send_queue.hpp"
#include "server/host/asio.hpp"

namespace drivebench::can::virtual_bus_test {
namespace {

// A wait of this length means that the test hangs.
constexpr auto kPatience = std::chrono::seconds(30);

Frame frame(std::uint32_t id, std::uint8_t value = 0) {
  return {.id = id, .size = 1, .data = {value}};
}

void run_until(asio::io_context& io, const std::function<bool()>& holds) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!holds() && std::chrono::steady_clock::now() < deadline)
    io.run_one_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(holds());
}

/// A port that is free at present.
std::uint16_t free_port(asio::io_context& io) {
  const asio::ip::tcp::acceptor probe(io, {asio::ip::make_address("127.0.0.1"), 0});
  return probe.local_endpoint().port();
}

// ---- the queue of frames that wait ----

// Catches: old frames that are sent after newer ones, or identifiers that overtake each other.
TEST(SendQueue, KeepsTheNewestFrameOfEachIdentifierInOrder) {
  SendQueue queue;
  EXPECT_EQ(queue.push(frame(2, 1)), 0u);
  EXPECT_EQ(queue.push(frame(1, 2)), 0u);
  EXPECT_EQ(queue.push(frame(2, 3)), 1u);
  Frame other = frame(2, 4);
  other.extended = true;
  EXPECT_EQ(queue.push(other), 0u) << "another identifier";
  other.extended = false;
  other.remote = true;
  EXPECT_EQ(queue.push(other), 0u) << "a request for the frame is not the frame";
  std::vector<int> values;
  for (; !queue.empty(); queue.pop())
    values.push_back(queue.front().data[0]);
  EXPECT_EQ(values, (std::vector<int>{3, 2, 4, 4}));
}

// Catches: a queue that grows with the number of identifiers, or that miscounts what it loses.
TEST(SendQueue, IsBounded) {
  SendQueue queue;
  std::uint64_t lost = 0;
  for (std::uint32_t id = 0; id < 3000; ++id) {
    Frame each = frame(id);
    each.extended = true;
    lost += queue.push(each);
  }
  EXPECT_EQ(lost, 3000u - SendQueue::kMaxPending);
  EXPECT_EQ(queue.clear(), SendQueue::kMaxPending);
  EXPECT_TRUE(queue.empty());
}

// ---- udp_multicast ----

class UdpMulticast : public testing::Test {
 protected:
  std::unique_ptr<Bus> open() {
    CanConfig config;
    config.port = port_;
    return make_udp_multicast_bus(io_, config);
  }

  asio::io_context io_;
  std::uint16_t port_ = free_port(io_);
};

// Catches: a bus that hears itself, a filter that lets others through, arrivals without their time.
TEST_F(UdpMulticast, CarriesFramesToOthersThroughTheirFilters) {
  const auto one = open();
  const auto other = open();
  std::vector<Frame> seen;
  std::int64_t stamp_ns = 0;
  one->on_frame = [&](const Frame&, std::int64_t) { ADD_FAILURE() << "its own frame"; };
  other->on_frame = [&](const Frame& each, std::int64_t stamp) {
    seen.push_back(each);
    stamp_ns = stamp;
  };
  other->set_filter({9, 7});
  Frame extended = frame(7);
  extended.extended = true;
  for (const Frame& each : {frame(7), frame(8), extended, frame(9)})
    one->send(each);
  run_until(io_, [&] { return seen.size() == 3; });
  EXPECT_EQ(seen, (std::vector<Frame>{frame(7), extended, frame(9)}));
  EXPECT_EQ(other->status().received, 4u);
  EXPECT_EQ(one->status().sent, 4u);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  EXPECT_NEAR(static_cast<double>(stamp_ns) * 1e-9, std::chrono::duration<double>(now).count(), 60.0);
}

// Catches: bursts without pacing, frames that overtake, a newest frame that never comes.
TEST_F(UdpMulticast, PacesABurstAndSendsTheNewest) {
  const auto one = open();
  const auto other = open();
  std::vector<int> values;
  other->on_frame = [&](const Frame& each, std::int64_t) {
    values.push_back(each.data[0] + 256 * each.data[1]);
  };
  // More than one burst only if this thread was away for so long that all of it could be sent.
  int sent = 0;
  for (int burst = 0; burst < 20 && one->status().send_dropped == 0; ++burst) {
    for (int i = 0; i < 1000; ++i, ++sent) {
      Frame each = frame(1, static_cast<std::uint8_t>(sent));
      each.size = 2;
      each.data[1] = static_cast<std::uint8_t>(sent >> 8);
      one->send(each);
    }
  }
  EXPECT_GT(one->status().send_dropped, 0u);
  EXPECT_GE(one->status().sent, 64u) << "as many at once";
  run_until(io_, [&] { return !values.empty() && values.back() == sent - 1; });
  EXPECT_TRUE(std::is_sorted(values.begin(), values.end()));
  EXPECT_EQ(one->status().sent, values.size());
  EXPECT_EQ(one->status().sent + one->status().send_dropped, static_cast<std::uint64_t>(sent));
}

// Catches: pacing that holds up an exchange of question and answer.
TEST_F(UdpMulticast, DoesNotHoldUpAnExchange) {
  const auto bench = open();
  const auto controller = open();
  int exchanges = 0;
  std::uint64_t held_up = 0;
  const auto start = [&] {
    const std::uint64_t before = bench->status().sent;
    for (std::uint32_t id = 1; id <= 3; ++id)
      bench->send(frame(id));
    held_up += before + 3 - bench->status().sent;
  };
  controller->on_frame = [&](const Frame& each, std::int64_t) {
    if (each.id == 3) controller->send(frame(4));
  };
  bench->on_frame = [&](const Frame&, std::int64_t) {
    if (++exchanges < 2000) start();
  };
  start();
  run_until(io_, [&] { return exchanges == 2000; });
  EXPECT_EQ(held_up, 0u);
  EXPECT_EQ(controller->status().received, 6000u);
}

// Catches: handlers that outlive their bus.
TEST_F(UdpMulticast, CanBeClosedWithFramesUnderWay) {
  const auto one = open();
  auto other = open();
  for (std::uint32_t id = 0; id < 500; ++id) {
    one->send(frame(id));
    other->send(frame(id));
  }
  other.reset();
  run_until(io_, [&] { return one->status().sent == 500; });
}

// Catches: an address that is no multicast group taken for a bus.
TEST_F(UdpMulticast, NeedsAMulticastGroup) {
  for (const char* channel : {"127.0.0.1", "can0", "", "::1", "240.0.0.0"}) {
    CanConfig config;
    config.channel = channel;
    EXPECT_THROW(make_udp_multicast_bus(io_, config), std::runtime_error) << channel;
  }
}

// ---- opening again ----

// Catches: a bus that is not required and yet ends the bench, or never comes up.
TEST(VirtualBus, OpensLaterIfItIsNotRequired) {
  asio::io_context io;
  auto holder = std::make_unique<asio::ip::tcp::acceptor>(
      io, asio::ip::tcp::endpoint(asio::ip::make_address("127.0.0.1"), 0));
  CanConfig config;
  config.backend = Backend::kSocketcand;
  config.channel = "127.0.0.1";
  config.port = holder->local_endpoint().port();
  EXPECT_THROW(make_socketcand_bus(io, config), std::runtime_error);
  config.required = false;
  const auto bus = make_socketcand_bus(io, config);
  EXPECT_EQ(bus->status().state, BusState::kAbsent);
  int changes = 0;
  bus->on_state = [&] { ++changes; };
  holder.reset();
  run_until(io, [&] { return bus->status().state == BusState::kUp; });
  EXPECT_EQ(changes, 1);
}

}  // namespace
}  // namespace drivebench::can::virtual_bus_test
