#include "tests/benchmark/exchange/can_wire.hpp"
#include "protocols/can/formats/kernel_frame.hpp"

#include <arpa/inet.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <chrono>
#include <cstring>

#include "protocols/can/formats/msgpack.hpp"
#include "tests/benchmark/harness/machine.hpp"

namespace drivebench::speed {
namespace {

static_assert(can::kMaxMsgpackFrame == 256);

template <class Value>
void set(const link::FileDescriptor& fd, int level, int option, const Value& value, const char* what) {
  check(::setsockopt(fd.get(), level, option, &value, sizeof value) == 0, what);
}

link::FileDescriptor open_socket(int family, int type, int protocol) {
  link::FileDescriptor fd(::socket(family, type | SOCK_CLOEXEC, protocol));
  check(fd.is_open(), "socket");
  set(fd, SOL_SOCKET, SO_RCVTIMEO, timeval{.tv_sec = 5, .tv_usec = 0}, "SO_RCVTIMEO");
  return fd;
}

sockaddr_in loopback() {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

const sockaddr* raw(const sockaddr_in& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

/// A socket of the loopback interface, and its address.
std::pair<link::FileDescriptor, sockaddr_in> loopback_socket() {
  link::FileDescriptor fd = open_socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address = loopback();
  socklen_t size = sizeof address;
  check(::bind(fd.get(), raw(address), size) == 0, "bind");
  check(::getsockname(fd.get(), reinterpret_cast<sockaddr*>(&address), &size) == 0, "getsockname");
  return {std::move(fd), address};
}

double seconds_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace

CanWire CanWire::multicast(const std::string& group, std::uint16_t port) {
  CanWire wire;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  check(::inet_pton(AF_INET, group.c_str(), &address.sin_addr) == 1, "inet_pton");
  ip_mreqn on_loopback{};
  on_loopback.imr_multiaddr = address.sin_addr;
  on_loopback.imr_ifindex = static_cast<int>(::if_nametoindex("lo"));

  wire.in_ = open_socket(AF_INET, SOCK_DGRAM, 0);
  set(wire.in_, SOL_SOCKET, SO_REUSEADDR, 1, "SO_REUSEADDR");
  check(::bind(wire.in_.get(), raw(address), sizeof address) == 0, "bind to the group");
  set(wire.in_, IPPROTO_IP, IP_ADD_MEMBERSHIP, on_loopback, "IP_ADD_MEMBERSHIP");

  auto [out, own] = loopback_socket();
  wire.out_ = std::move(out);
  wire.own_port_ = own.sin_port;
  set(wire.out_, IPPROTO_IP, IP_MULTICAST_IF, on_loopback, "IP_MULTICAST_IF");
  set(wire.out_, IPPROTO_IP, IP_MULTICAST_TTL, 0, "IP_MULTICAST_TTL");
  check(::connect(wire.out_.get(), raw(address), sizeof address) == 0, "connect to the group");
  return wire;
}

std::pair<CanWire, CanWire> CanWire::unicast() {
  std::pair<CanWire, CanWire> ends;
  auto [first, first_address] = loopback_socket();
  auto [second, second_address] = loopback_socket();
  check(::connect(first.get(), raw(second_address), sizeof second_address) == 0, "connect");
  check(::connect(second.get(), raw(first_address), sizeof first_address) == 0, "connect");
  ends.first.in_ = std::move(first);
  ends.second.in_ = std::move(second);
  return ends;
}

CanWire CanWire::socketcan(const std::string& interface) {
  CanWire wire;
  wire.is_kernel_can_ = true;
  wire.in_ = open_socket(PF_CAN, SOCK_RAW, CAN_RAW);
  set(wire.in_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1, "CAN_RAW_FD_FRAMES");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  check(address.can_ifindex != 0 &&
            ::bind(wire.in_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0,
        "bind to the CAN interface");
  return wire;
}

void CanWire::send(Bytes datagram) {
  const int fd = out_.is_open() ? out_.get() : in_.get();
  check(::send(fd, datagram.data(), datagram.size(), 0) >= 0, "send");
}

Bytes CanWire::receive() {
  for (;;) {
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t got = own_port_ == 0 ? ::recv(in_.get(), received_.data(), received_.size(), 0)
                                       : ::recvfrom(in_.get(), received_.data(), received_.size(), 0,
                                                    reinterpret_cast<sockaddr*>(&from), &size);
    check(got > 0, "receive");
    if (own_port_ == 0 || from.sin_port != own_port_) {
      return Bytes(received_).first(static_cast<std::size_t>(got));
    }
  }
}

Bytes CanWire::datagram_of(const can::Frame& frame) {
  if (!is_kernel_can_) {
    return Bytes(encoded_).first(can::encode_msgpack(frame, seconds_since_1970(), encoded_));
  }
  const canfd_frame kernel = can::raw_of(frame);
  std::memcpy(raw_.data(), &kernel, sizeof kernel);
  return Bytes(raw_).first(frame.fd ? CANFD_MTU : CAN_MTU);
}

std::optional<can::Frame> CanWire::frame_of(Bytes datagram) const {
  if (!is_kernel_can_) return can::decode_msgpack(datagram);
  canfd_frame kernel{};
  std::memcpy(&kernel, datagram.data(), std::min(datagram.size(), sizeof kernel));
  return can::frame_of(kernel, datagram.size() == CANFD_MTU);
}

std::uint16_t free_udp_port() {
  return ntohs(loopback_socket().second.sin_port);
}

bool has_can(const std::string& interface) {
  const link::FileDescriptor fd(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  return fd.is_open() && ::if_nametoindex(interface.c_str()) != 0;
}

}  // namespace drivebench::speed
