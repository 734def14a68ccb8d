// The bus inside the process, on which tests of other code rely.
#include <gtest/gtest.h>
#include <linux/can/error.h>

#include "tests/server/endpoints/can/memory_bus.hpp"

namespace drivebench::can::memory_bus_test {
namespace {

Frame data_frame(std::uint32_t id, std::uint8_t first = 0) {
  Frame frame{.id = id, .size = 8};
  frame.data[0] = first;
  return frame;
}

class MemoryBusTest : public testing::Test {
 protected:
  void SetUp() override {
    for (auto& [bus, heard] : ports_) {
      bus->on_frame = [&into = heard](const Frame& frame, std::int64_t) { into.push_back(frame); };
    }
    bench_.on_state = [this] { states_.push_back(bench_.status().state); };
  }
  void run() {
    io_.restart();
    io_.run();
  }

  struct Port {
    std::unique_ptr<Bus> bus;
    std::vector<Frame> heard;
  };
  asio::io_context io_;
  MemoryWire wire_{io_};
  std::array<Port, 3> ports_{Port{wire_.connect("bench"), {}}, Port{wire_.connect("1"), {}},
                             Port{wire_.connect("2"), {}}};
  Bus& bench_ = *ports_[0].bus;
  std::vector<BusState> states_;
};

// Catches: frames heard by their sender, from inside send(), or in another order on another port.
TEST_F(MemoryBusTest, EveryOtherPortReceivesInTheOrderOfSending) {
  ports_[0].bus->send(data_frame(1));
  ports_[1].bus->send(data_frame(2));
  ports_[0].bus->send(data_frame(3));
  EXPECT_TRUE(ports_[2].heard.empty());
  run();
  EXPECT_EQ(ports_[0].heard, (std::vector{data_frame(2)}));
  EXPECT_EQ(ports_[1].heard, (std::vector{data_frame(1), data_frame(3)}));
  EXPECT_EQ(ports_[2].heard, (std::vector{data_frame(1), data_frame(2), data_frame(3)}));
}

// Catches: an answer that is delivered inside the delivery that it answers: two endpoints would recurse
// without end.
TEST_F(MemoryBusTest, AnAnswerIsDeliveredAfterItsQuestion) {
  int depth = 0;
  int answers = 0;
  for (const std::size_t port : {0u, 1u}) {
    Bus& bus = *ports_[port].bus;
    bus.on_frame = [&](const Frame& frame, std::int64_t) {
      EXPECT_EQ(++depth, 1);
      if (++answers < 1000) bus.send(frame);
      --depth;
    };
  }
  ports_[2].bus->send(data_frame(1));
  run();
  EXPECT_GE(answers, 1000);
}

// Catches: a filter that differs from the kernel's.
TEST_F(MemoryBusTest, CAN_09_AFilterLetsRemoteFramesAndLookAlikesThrough) {
  ports_[0].bus->set_filter({0x101, 0x55});
  const Frame remote{.id = 0x101, .remote = true, .size = 8};
  const Frame look_alike{.id = 0x101, .extended = true};
  ports_[1].bus->send(look_alike);
  ports_[1].bus->send(data_frame(0x102));
  ports_[1].bus->send(remote);
  ports_[1].bus->send(data_frame(0x55));
  run();
  EXPECT_EQ(ports_[0].heard, (std::vector{look_alike, remote, data_frame(0x55)}));
  EXPECT_EQ(ports_[0].bus->status().received, 3u);
}

// Catches: a full bus that queues without end, forgets, or sends old frames before new ones.
TEST_F(MemoryBusTest, CAN_01_AFullBusKeepsTheNewestOfEachIdentifier) {
  wire_.set_full(true);
  for (std::uint8_t i = 0; i < 100; ++i) {
    bench_.send(data_frame(1, i));
    bench_.send(data_frame(2, i));
  }
  run();
  EXPECT_TRUE(ports_[1].heard.empty());
  EXPECT_EQ(bench_.status().sent, 0u);
  wire_.set_full(false);
  run();
  EXPECT_EQ(ports_[1].heard, (std::vector{data_frame(1, 99), data_frame(2, 99)}));
  EXPECT_EQ(bench_.status().sent, 2u);
  EXPECT_EQ(bench_.status().send_dropped, 198u);
}

// Catches: frames that survive a cable that is out; a change of state without a call of on_state.
TEST_F(MemoryBusTest, CAN_02_CAN_03_CAN_04_FramesSentOrUnderWayAreLostWhileItIsDown) {
  bench_.send(data_frame(1));
  wire_.set_link(BusState::kDown);
  bench_.send(data_frame(2));
  run();
  EXPECT_EQ(states_, (std::vector{BusState::kDown}));
  wire_.set_link(BusState::kAbsent);
  run();
  wire_.set_link(BusState::kUp);
  run();
  bench_.send(data_frame(3));
  run();
  EXPECT_EQ(ports_[1].heard, (std::vector{data_frame(3)}));
  EXPECT_EQ(bench_.status().send_dropped, 1u);
  EXPECT_EQ(states_, (std::vector{BusState::kDown, BusState::kAbsent, BusState::kUp}));
  bench_.send(data_frame(4));
  wire_.set_link(BusState::kDown);
  wire_.set_link(BusState::kUp);
  run();
  EXPECT_EQ(ports_[1].heard.size(), 1u);
}

// Catches: error frames taken for messages.
TEST_F(MemoryBusTest, CAN_06_ErrorFramesChangeTheState) {
  Frame passive{.id = CAN_ERR_CRTL, .size = 8};
  passive.data[1] = CAN_ERR_CRTL_TX_PASSIVE;
  wire_.report(passive);
  run();
  wire_.report({.id = CAN_ERR_BUSOFF, .size = 8});
  run();
  bench_.send(data_frame(1));
  run();
  EXPECT_EQ(states_, (std::vector{BusState::kPassive, BusState::kDown}));
  EXPECT_EQ(bench_.status().error_frames, 2u);
  EXPECT_EQ(bench_.status().send_dropped, 1u);
  EXPECT_TRUE(ports_[0].heard.empty());
  EXPECT_TRUE(ports_[1].heard.empty());
}

// Catches: losses that are not counted, or that are told before the kernel would tell them.
TEST_F(MemoryBusTest, CAN_07_LostFramesAreReportedWithTheNextOne) {
  wire_.lose(2);
  bench_.send(data_frame(1));
  bench_.send(data_frame(2));
  run();
  EXPECT_EQ(ports_[1].bus->status().receive_dropped, 0u);
  bench_.send(data_frame(3));
  run();
  EXPECT_EQ(ports_[1].heard, (std::vector{data_frame(3)}));
  EXPECT_EQ(ports_[1].bus->status().receive_dropped, 2u);
}

// Catches: a port or wire that is called after its end.
TEST_F(MemoryBusTest, PortsAndHandlersOutliveEachOther) {
  bench_.send(data_frame(1));
  wire_.set_link(BusState::kDown);
  wire_.set_link(BusState::kUp);
  bench_.send(data_frame(2));
  ports_[0].bus.reset();
  ports_[1].bus.reset();
  run();
  EXPECT_TRUE(ports_[2].heard.empty());  // its sender took the frame along
  auto wire = std::make_unique<MemoryWire>(io_);
  const std::unique_ptr<Bus> left_over = wire->connect("left over");
  left_over->send(data_frame(1));
  wire.reset();
  left_over->send(data_frame(1));
  run();
  EXPECT_EQ(left_over->status().send_dropped, 1u);
}

}  // namespace
}  // namespace drivebench::can::memory_bus_test
