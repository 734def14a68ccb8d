// The SocketCAN back end on the kernel's own CAN stack. Every test makes a vcan interface of its own.
#include "tests/server/endpoints/can/socketcan_test.hpp"

#include <sys/wait.h>

#include <map>
#include <random>

namespace drivebench::can::socketcan_test {
namespace {

// Catches: sizes, flags or bytes of a frame changed on the way, in either direction.
TEST_F(SocketCan, FramesOfEveryKindCrossUnchanged) {
  CanConfig with_fd = config();
  with_fd.profile.fd = true;
  open(with_fd);
  const Peer peer(interface_);
  Frame fd{.id = 0x1ABCDEF0, .extended = true, .fd = true, .bit_rate_switch = true, .size = 64};
  for (std::size_t i = 0; i < 64; ++i)
    fd.data[i] = static_cast<std::uint8_t>(i * 3 + 1);
  const std::vector<Frame> sent = {data_frame(0x7FF, 0xA5), {.id = 0x123, .remote = true, .size = 4}, fd};
  for (const Frame& frame : sent)
    bus_->send(frame);
  EXPECT_EQ(peer.receive_all(sent.size()), sent);
  EXPECT_EQ(bus_->status().sent, 3u);

  peer.send(0x7FF, {0xA5, 0, 0, 0, 0, 0, 0, 0});
  peer.send(0x123 | CAN_RTR_FLAG, {0, 0, 0, 0});
  peer.send(0x12345 | CAN_EFF_FLAG, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, true);
  ASSERT_TRUE(run_until_heard(3));
  EXPECT_EQ(heard_[0], sent[0]);
  EXPECT_EQ(heard_[1], sent[1]);
  EXPECT_TRUE(heard_[2].extended && heard_[2].fd);
  EXPECT_EQ(heard_[2].id, 0x12345u);
  EXPECT_EQ(heard_[2].size, 12);
  EXPECT_EQ(heard_[2].data[11], 12);
  EXPECT_EQ(bus_->status().received, 3u);
}

// Catches: frames lost for good or reordered when the interface is full; a queue that grows; a core that
// spins.
TEST_F(SocketCan, CAN_01_AFullInterfaceKeepsTheNewestOfEachIdentifier) {
  // Room for two frames at a time, and some 60 a second.
  if (!shell("tc qdisc add dev " + interface_ + " root tbf rate 8kbit burst 32 limit 32")) {
    GTEST_SKIP() << "no tbf queue here";
  }
  open(config());
  const Peer peer(interface_);
  for (std::uint8_t round = 0; round < 20; ++round) {
    for (const std::uint32_t id : {0x101u, 0x102u, 0x103u})
      bus_->send(data_frame(id, round));
  }
  const BusStatus& status = bus_->status();
  EXPECT_GT(status.send_dropped, 0u);
  EXPECT_LT(status.sent, 20u);
  // There is room again, but others wait for it.
  ::usleep(100'000);
  bus_->send(data_frame(0x104, 19));
  int handlers = 0;
  std::map<std::uint32_t, std::uint8_t> newest;
  std::vector<Frame> arrived;
  ASSERT_TRUE(run_until([&] {
    ++handlers;
    for (const Frame& frame : peer.receive_all()) {
      newest[frame.id] = frame.data[0];
      arrived.push_back(frame);
    }
    return newest[0x101] == 19 && newest[0x102] == 19 && newest[0x103] == 19 && newest[0x104] == 19;
  }));
  EXPECT_EQ(arrived.back().id, 0x104u);
  EXPECT_EQ(status.sent, arrived.size());
  EXPECT_EQ(status.sent + status.send_dropped, 61u);
  EXPECT_LT(handlers, 2000);  // one a millisecond, not one a microsecond
  EXPECT_EQ(status.state, BusState::kUp);
}

// Catches: a link that goes down unnoticed; a socket that is reopened in vain; old frames sent after the
// pause.
TEST_F(SocketCan, CAN_02_CAN_03_ALinkThatGoesDownAndUpAgain) {
  open(config());
  EXPECT_EQ(bus_->status().state, BusState::kUp);
  ASSERT_TRUE(set("down"));
  ASSERT_TRUE(run_until_state(BusState::kDown));  // without having sent anything
  bus_->send(data_frame(0x101, 1));
  EXPECT_EQ(bus_->status().send_dropped, 1u);
  ASSERT_TRUE(set("up"));
  ASSERT_TRUE(run_until_state(BusState::kUp));
  const Peer peer(interface_);
  peer.send(0x55, {9});
  ASSERT_TRUE(run_until_heard(1));
  bus_->send(data_frame(0x101, 2));
  const std::vector<Frame> sent = peer.receive_all(1);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].data[0], 2);
  EXPECT_EQ(states_, (std::vector{BusState::kDown, BusState::kUp}));
}

// Catches: a state told from inside send(), where the listener may send again.
TEST_F(SocketCan, CAN_02_SendingNoticesALinkThatIsDownAndReportsItLater) {
  open(config());
  ASSERT_TRUE(set("down"));
  bus_->send(data_frame(0x101));
  EXPECT_EQ(bus_->status().state, BusState::kDown);
  EXPECT_EQ(bus_->status().send_dropped, 1u);
  EXPECT_TRUE(states_.empty());
  ASSERT_TRUE(run_until_state(BusState::kDown));
}

// Catches: a socket bound to an interface that is gone, kept because another one has its name.
TEST_F(SocketCan, CAN_04_AnInterfaceThatIsMadeAgainIsOpenedAgain) {
  open(config());
  bus_->set_filter({0x55});
  for (int round = 1; round <= 3; ++round) {
    ASSERT_TRUE(shell("ip link del " + interface_));
    if (round == 2) bus_->send(data_frame(0x101));  // learns it from a send, the other times from a read
    ASSERT_TRUE(run_until_state(BusState::kAbsent));
    ASSERT_TRUE(add_interface());
    ASSERT_TRUE(run_until_state(BusState::kUp));
    const Peer peer(interface_);
    peer.send(0x56, {1});  // the filter is back too
    peer.send(0x55, {2});
    ASSERT_TRUE(run_until_heard(static_cast<std::size_t>(round)));
    EXPECT_EQ(heard_.back().id, 0x55u);
    bus_->send(data_frame(0x101));
    EXPECT_EQ(peer.receive_all(1).size(), 1u);
  }
}

// Catches: a bench that starts without the bus it needs, or does not start because of one that it can do
// without.
TEST_F(SocketCan, CAN_05_AMissingInterfaceIsRefusedOrWaitedFor) {
  ASSERT_TRUE(shell("ip link del " + interface_));
  try {
    open(config());
    FAIL() << "opened a missing interface";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("ip link add dev dbtest0 type vcan"), std::string::npos)
        << error.what();
  }
  open(config(false));
  EXPECT_EQ(bus_->status().state, BusState::kAbsent);
  bus_->send(data_frame(0x101));
  EXPECT_EQ(bus_->status().send_dropped, 1u);
  ASSERT_TRUE(add_interface());
  ASSERT_TRUE(run_until_state(BusState::kUp));
}

// Catches: an interface without FD taken for one with it, which then drops every frame; a wrong kind of
// interface.
TEST_F(SocketCan, CAN_05_AnInterfaceThatCannotCarryTheFramesIsRefused) {
  ASSERT_TRUE(shell("ip link del " + interface_));
  ASSERT_TRUE(add_interface(16));
  CanConfig with_fd = config();
  with_fd.profile.fd = true;
  EXPECT_THROW(open(with_fd), std::runtime_error);
  open(config());
  EXPECT_EQ(bus_->status().state, BusState::kUp);
  CanConfig loopback = config();
  loopback.channel = "lo";
  EXPECT_THROW(open(loopback), std::runtime_error);
  loopback.channel = "a_name_that_is_far_too_long";
  EXPECT_THROW(open(loopback), std::runtime_error);
}

// Catches: an error frame taken for a message; a bus-off that goes unnoticed or never ends.
TEST_F(SocketCan, CAN_06_ErrorFramesChangeTheStateAndAreNoMessages) {
  open(config());
  bus_->set_filter({0x0, 0x4, 0x40});  // the class bits, read as identifiers
  const Peer peer(interface_);
  const auto report = [&](std::uint32_t what, std::uint8_t controller) {
    peer.send(CAN_ERR_FLAG | what, {0, controller, 0, 0, 0, 0, 0, 0});
  };
  report(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING);
  ASSERT_TRUE(run_until_state(BusState::kWarning));
  report(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE);
  ASSERT_TRUE(run_until_state(BusState::kPassive));
  report(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE);
  ASSERT_TRUE(run_until_state(BusState::kUp));
  const std::size_t states_before = states_.size();
  for (const std::uint32_t what : {CAN_ERR_ACK, CAN_ERR_LOSTARB, CAN_ERR_PROT})
    report(what, 0);
  report(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW);
  ASSERT_TRUE(run_until([&] { return bus_->status().error_frames == 7; }));
  EXPECT_EQ(states_.size(), states_before);
  EXPECT_EQ(bus_->status().receive_dropped, 1u);  // the controller had no room for a frame
  report(CAN_ERR_BUSOFF, 0);
  ASSERT_TRUE(run_until_state(BusState::kDown));
  report(CAN_ERR_RESTARTED, 0);
  ASSERT_TRUE(run_until_state(BusState::kUp));
  EXPECT_TRUE(heard_.empty());
  EXPECT_EQ(bus_->status().error_frames, 9u);
}

// Catches: a receive buffer that is too small for 100 ms; dropped frames that are not counted.
TEST_F(SocketCan, CAN_07_FramesThatTheKernelDropsAreCounted) {
  open(config());
  const Peer peer(interface_);
  // 100 ms of the shortest classic frames at 1 Mbit/s.
  constexpr std::size_t kFull = 1'000'000 / 10 / 47;
  for (std::size_t i = 0; i < kFull; ++i)
    peer.send(0x55, {});
  ASSERT_TRUE(run_until_heard(kFull));
  EXPECT_EQ(bus_->status().receive_dropped, 0u);
  constexpr std::size_t kFlood = 4 * kFull;
  for (int round = 1; round <= 2; ++round) {
    for (std::size_t i = 0; i < kFlood; ++i)
      peer.send(0x55, {});
    ASSERT_TRUE(run_until([&] { return io_.poll() == 0; }));
    peer.send(0x56, {});  // the kernel tells with the next frame that comes through
    ASSERT_TRUE(run_until([&] { return heard_.back().id == 0x56; }));
    heard_.push_back(Frame{});
  }
  EXPECT_GT(bus_->status().receive_dropped, kFull);
  EXPECT_EQ(bus_->status().received + bus_->status().receive_dropped, kFull + 2 * (kFlood + 1));
}

// Catches: foreign frames that wake the bench: full load of them would take a core.
TEST_F(SocketCan, CAN_08_ForeignIdentifiersDoNotWakeTheBench) {
  open(config());
  bus_->set_filter({0x101, 0x102, 0x301});
  while (io_.poll() > 0) {
  }
  const Peer peer(interface_);
  for (std::uint32_t id = 0x103; id < 0x301; ++id)
    peer.send(id, {1});
  io_.restart();
  EXPECT_EQ(io_.poll(), 0u);
  peer.send(0x102, {1});
  ASSERT_TRUE(run_until_heard(1));
  EXPECT_EQ(heard_[0].id, 0x102u);
}

// Catches: look-alikes with 29 bits, remote and FD frames that vanish instead of being counted, or that lose
// what tells them apart.
TEST_F(SocketCan, CAN_09_LookAlikesAreCountedByKind) {
  open(config());
  bus_->set_filter({0x101});
  const Peer peer(interface_);
  peer.send(0x101 | CAN_EFF_FLAG, {1});
  peer.send(0x101 | CAN_RTR_FLAG, {});
  peer.send(0x101, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, true);
  peer.send(0x40101 | CAN_EFF_FLAG, {1});
  peer.send(0x101, {1, 2, 3});
  ASSERT_TRUE(run_until_heard(4));
  EXPECT_TRUE(heard_[0].extended);
  EXPECT_TRUE(heard_[1].remote);
  EXPECT_TRUE(heard_[2].fd);
  EXPECT_EQ(heard_[3].size, 3);
}

// Catches: the bench's own frames taken for those of another bench with the same identifiers.
TEST_F(SocketCan, CAN_10_OwnFramesAreConfirmedAndNotDelivered) {
  open(config(), true);
  bus_->set_filter({0x101});
  const Peer peer(interface_);
  for (int i = 0; i < 40; ++i)
    bus_->send(data_frame(0x101));
  peer.send(0x101, {1});
  ASSERT_TRUE(run_until_heard(1));
  ASSERT_TRUE(run_until([&] { return bus_->status().confirmed == 40; }));
  EXPECT_EQ(heard_.size(), 1u);
  EXPECT_EQ(bus_->status().received, 1u);
}

// Catches: stamps from another clock, or of the reading instead of the arrival. That they may jump back
// (can-utils issue 233) does no harm: frames are delivered in the order of the queue.
TEST_F(SocketCan, CAN_13_StampsAreOfTheArrivalAndOrderIsOfTheQueue) {
  open(config());
  const auto now = [] {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
  };
  const Peer peer(interface_);
  const std::int64_t before = now();
  for (std::uint8_t i = 0; i < 100; ++i)
    peer.send(0x55, {i});
  const std::int64_t after = now();
  ASSERT_TRUE(run_until_heard(100));
  EXPECT_GE(last_stamp_ns_, before);
  EXPECT_LE(last_stamp_ns_, after);
  for (std::uint8_t i = 0; i < 100; ++i)
    EXPECT_EQ(heard_[i].data[0], i);
}

// Catches: anything that wants a capability.
TEST_F(SocketCan, CAN_14_AnOrdinaryUserMayOpenIt) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (::setgid(65534) != 0 || ::setuid(65534) != 0) ::_exit(2);
    asio::io_context io;
    SocketCanBus bus(io, config());
    bus.send(data_frame(0x101));
    ::_exit(bus.status().state == BusState::kUp && bus.status().sent == 1 ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

// Catches: more identifiers than the kernel takes filters.
TEST_F(SocketCan, AFilterForSixtyFourAxes) {
  open(config());
  std::vector<std::uint32_t> ids;
  for (std::uint32_t base = 0x080; base < 0x780; base += 0x80)
    for (std::uint32_t node = 1; node <= 64; ++node)
      ids.push_back(base + node);
  bus_->set_filter(ids);
  const Peer peer(interface_);
  std::vector<std::uint32_t> expected;
  for (std::uint32_t id = 0; id < 0x800; ++id) {
    peer.send(id, {});
    if (std::find(ids.begin(), ids.end(), id) != ids.end()) expected.push_back(id);
  }
  ASSERT_TRUE(run_until_heard(ids.size()));
  std::vector<std::uint32_t> heard;
  for (const Frame& frame : heard_)
    heard.push_back(frame.id);
  EXPECT_EQ(heard, expected);
}

// Catches: a merged filter that lets a foreign identifier through or keeps a wanted one out.
TEST(SocketCanFilters, AreExactForAnySet) {
  std::mt19937 random(7);
  for (int round = 0; round < 50; ++round) {
    std::vector<bool> wanted(0x800);
    std::vector<std::uint32_t> ids;
    for (std::uint32_t id = 0; id < 0x800; ++id) {
      wanted[id] = random() % 50 < static_cast<unsigned>(round);
      if (wanted[id]) ids.push_back(id);
    }
    std::shuffle(ids.begin(), ids.end(), random);
    const std::vector<can_filter> filters = filters_for(ids);
    for (std::uint32_t id = 0; id < 0x800; ++id) {
      for (const std::uint32_t flag : {0u, CAN_EFF_FLAG}) {
        const bool passes = std::any_of(filters.begin(), filters.end(), [&](const can_filter& filter) {
          return ((id | flag) & filter.can_mask) == (filter.can_id & filter.can_mask);
        });
        ASSERT_EQ(passes, wanted[id]) << id;
      }
    }
  }
}

}  // namespace
}  // namespace drivebench::can::socketcan_test
