// The client's back ends against the other end of a socket. Kernel CAN and real peers are in the CAN tests.
#include "clients/link/can/can_bus.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <future>
#include <string>
#include <vector>

#include "clients/link/common/address.hpp"

namespace drivebench::link::can_bus_test {
namespace {

using namespace std::chrono_literals;
using Clock = CanBus::Clock;

/// Accepts one connection on a port that the system chose.
class Listener {
 public:
  Listener() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in here = {};
    here.sin_family = AF_INET;
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof here;
    ::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&here), size);
    ::listen(fd_.get(), 1);
    ::getsockname(fd_.get(), reinterpret_cast<sockaddr*>(&here), &size);
    place_ = "127.0.0.1:" + std::to_string(ntohs(here.sin_port));
  }
  const std::string& place() const { return place_; }
  FileDescriptor accept() const {
    return FileDescriptor(::accept4(fd_.get(), nullptr, nullptr, SOCK_CLOEXEC));
  }

 private:
  FileDescriptor fd_;
  std::string place_;
};

void say(const FileDescriptor& fd, const std::string& text) {
  ASSERT_EQ(::send(fd.get(), text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
}

/// As much as was sent, up to this end; what came before the other end closed if it never does.
std::string hear(const FileDescriptor& fd, const std::string& end) {
  std::string heard;
  for (char byte = 0; !heard.ends_with(end) && ::recv(fd.get(), &byte, 1, 0) == 1;)
    heard += byte;
  return heard;
}

can::Frame frame_of(std::uint32_t id, std::vector<std::uint8_t> data) {
  can::Frame frame;
  frame.id = id;
  frame.size = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data.begin());
  return frame;
}

// Catches: an adapter that is not opened, a frame cut in two by the network and lost, an answer taken for a
// frame, and a bus that ends unnoticed.
TEST(CanBus, SlcanOpensTheAdapterAndExchangesFrames) {
  const Listener listener;
  const auto bus = open_can_bus(parse_can_address("can:slcan:tcp:" + listener.place() + "?fd=0"), 5s);
  const FileDescriptor peer = listener.accept();
  EXPECT_EQ(hear(peer, "O\r"), "\rC\rS8\rO\r");
  bus->send(frame_of(0x201, {1, 2}));
  EXPECT_EQ(hear(peer, "\r"), "t20120102\r");

  EXPECT_FALSE(bus->receive(Clock::time_point::min()).has_value());
  say(peer, "\r\az\rt18101\at1812AAB");
  EXPECT_FALSE(bus->receive(Clock::now() + 1ms).has_value());
  say(peer, "B\rt28110");
  EXPECT_EQ(bus->receive(Clock::now() + 5s), frame_of(0x181, {0xAA, 0xBB}));
  say(peer, "7\r");
  EXPECT_EQ(bus->receive(Clock::now() + 5s), frame_of(0x281, {7}));
  ::shutdown(peer.get(), SHUT_RDWR);
  EXPECT_THROW(bus->receive(Clock::now() + 5s), LinkError);
}

// Catches: a session that is not opened in the server's order, and frames that come with the last answer
// lost.
TEST(CanBus, SocketcandOpensASessionAndExchangesFrames) {
  const Listener listener;
  auto opening = std::async(std::launch::async, [&listener] {
    return open_can_bus(parse_can_address("can:socketcand:" + listener.place() + "?bus=vcan7"), 5s);
  });
  const FileDescriptor peer = listener.accept();
  say(peer, "< hi >");
  EXPECT_EQ(hear(peer, ">"), "< open vcan7 >");
  say(peer, "< ok >");
  EXPECT_EQ(hear(peer, ">"), "< rawmode >");
  say(peer, "< ok >< frame 181 1.000000 AABB >");
  const auto bus = opening.get();
  EXPECT_EQ(bus->receive(Clock::now() + 5s), frame_of(0x181, {0xAA, 0xBB}));
  bus->send(frame_of(0x201, {1, 0x20}));
  EXPECT_EQ(hear(peer, ">"), "< send 201 2 01 20 >");
}

// Catches: a server that speaks something else and is believed.
TEST(CanBus, SocketcandRefusesAnotherProtocol) {
  const Listener listener;
  auto opening = std::async(std::launch::async, [&listener] {
    return open_can_bus(parse_can_address("can:socketcand:" + listener.place()), 5s);
  });
  const FileDescriptor peer = listener.accept();
  say(peer, "< hello >");
  try {
    opening.get();
    ADD_FAILURE();
  } catch (const ConnectError& error) {
    EXPECT_NE(std::string(error.what()).find("says 'hello', not 'hi'"), std::string::npos) << error.what();
  }
}

/// A port that is free at present.
std::uint16_t free_udp_port() {
  const FileDescriptor probe(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in here{};
  here.sin_family = AF_INET;
  socklen_t size = sizeof(here);
  EXPECT_EQ(::bind(probe.get(), reinterpret_cast<const sockaddr*>(&here), size), 0);
  EXPECT_EQ(::getsockname(probe.get(), reinterpret_cast<sockaddr*>(&here), &size), 0);
  return ntohs(here.sin_port);
}

// Catches: own frames that come back, frames of another bus, and a lost flag of an FD frame.
TEST(CanBus, MulticastIsABusPerPort) {
  const std::string place = "can:udp_multicast:239.74.163.77:" + std::to_string(free_udp_port());
  std::unique_ptr<CanBus> one;
  std::unique_ptr<CanBus> two;
  try {
    one = open_can_bus(parse_can_address(place), 5s);
    two = open_can_bus(parse_can_address(place), 5s);
  } catch (const ConnectError& error) {
    GTEST_SKIP() << "no multicast here: " << error.what();
  }
  can::Frame frame = frame_of(0x181, std::vector<std::uint8_t>(32, 9));
  frame.fd = frame.bit_rate_switch = true;
  one->send(frame);
  EXPECT_EQ(two->receive(Clock::now() + 5s), frame);
  EXPECT_FALSE(one->receive(Clock::now() + 20ms).has_value());
}

// Catches: a missing interface or terminal that is noticed only when the first frame is sent.
TEST(CanBus, AMissingTransportIsAConnectError) {
  for (const char* text : {"can:socketcan:nosuch0", "can:slcan:/dev/null", "can:slcan:/nowhere/tty",
                           "can:socketcand:127.0.0.1:1"}) {
    EXPECT_THROW(open_can_bus(parse_can_address(text), 1s), ConnectError) << text;
  }
}

}  // namespace
}  // namespace drivebench::link::can_bus_test
