#include <arpa/inet.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>

#include "clients/link/can/bus_socket.hpp"
#include "clients/link/can/can_bus_kind.hpp"
#include "protocols/can/formats/msgpack.hpp"
#include "protocols/can/formats/text.hpp"

namespace drivebench::link {
namespace {

using can::Frame;
using Clock = CanBus::Clock;

double seconds_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// The virtual bus of python-can. Frames are sent from a separate port, by which the bus recognises its own
/// frames.
class MulticastBus final : public CanBus {
 public:
  explicit MulticastBus(const CanAddress& address)
      : name_(to_string(address)),
        in_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)),
        out_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in group = {};
    group.sin_family = AF_INET;
    group.sin_port = htons(address.port);
    ::inet_pton(AF_INET, address.channel.c_str(), &group.sin_addr);
    const auto* peer = reinterpret_cast<const sockaddr*>(&group);
    try {
      set_option(in_, SOL_SOCKET, SO_REUSEADDR, 1);
      if (::bind(in_.get(), peer, sizeof group) != 0) throw ConnectError(reason());
      // Always over the loopback interface, so that no frame leaves this computer.
      ip_mreqn request = {.imr_multiaddr = group.sin_addr,
                          .imr_address = {},
                          .imr_ifindex = static_cast<int>(::if_nametoindex("lo"))};
      set_option(in_, IPPROTO_IP, IP_ADD_MEMBERSHIP, request);
      set_option(out_, IPPROTO_IP, IP_MULTICAST_IF, request);
      set_option(out_, IPPROTO_IP, IP_MULTICAST_TTL, 0);
      // Joins also on the default interface, where programs send that choose none; fails without a route.
      request.imr_ifindex = 0;
      ::setsockopt(in_.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request);
      if (::connect(out_.get(), peer, sizeof group) != 0) throw ConnectError(reason());
    } catch (const ConnectError& error) {
      throw ConnectError("there is no " + name_ + ": " + error.what());
    }
    sockaddr_in own = {};
    socklen_t size = sizeof own;
    ::getsockname(out_.get(), reinterpret_cast<sockaddr*>(&own), &size);
    own_port_ = own.sin_port;
    set_patience(in_);
  }

  void send(const Frame& frame) override {
    std::array<std::byte, can::kMaxMsgpackFrame> bytes{};
    const std::size_t size = can::encode_msgpack(frame, seconds_since_1970(), bytes);
    while (::send(out_.get(), bytes.data(), size, 0) < 0) {
      if (errno != EINTR) throw LinkError(name_ + " failed: " + reason());
    }
  }

  std::optional<Frame> receive(Clock::time_point until) override {
    for (;;) {
      std::array<std::byte, 4096> bytes{};
      sockaddr_in from = {};
      const std::size_t size = receive_datagram(name_, until, [&](int flags) {
        socklen_t from_size = sizeof from;
        return ::recvfrom(in_.get(), bytes.data(), bytes.size(), flags, reinterpret_cast<sockaddr*>(&from),
                          &from_size);
      });
      if (size == 0) return std::nullopt;
      const bool own = from.sin_port == own_port_;
      if (auto frame = own ? std::nullopt : can::decode_msgpack(std::span(bytes).first(size))) return frame;
      if (until <= Clock::now())
        return std::nullopt;  // own frames and other datagrams do not extend the wait
    }
  }

 private:
  std::string name_;
  FileDescriptor in_;
  FileDescriptor out_;
  in_port_t own_port_ = 0;
};

std::string read_group(std::string_view text, CanAddress& address) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::string_view port = text.substr(std::min(colon + 1, text.size()));
  const can::BackendRow& row = can::row_of(can::Backend::kUdpMulticast);
  address.channel = colon == 0 ? row.default_channel : text.substr(0, colon);
  in_addr ip = {};
  if (::inet_pton(AF_INET, address.channel.c_str(), &ip) != 1 || (ntohl(ip.s_addr) >> 28) != 0xE) {
    return "after udp_multicast: comes an IPv4 group, 224.0.0.0 to 239.255.255.255, and a port";
  }
  address.port = port.empty() ? row.default_port : can::parse_number<std::uint16_t>(port, 10).value_or(0);
  return address.port != 0 ? "" : "the port must be a number from 1 to 65535";
}

}  // namespace

constinit const CanBusKind kUdpMulticast = {
    .backend = can::Backend::kUdpMulticast,
    .read_channel = read_group,
    .open = [](const CanAddress& address, std::chrono::milliseconds, std::span<const std::uint32_t>)
        -> std::unique_ptr<CanBus> { return std::make_unique<MulticastBus>(address); }};

}  // namespace drivebench::link
