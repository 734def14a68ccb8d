#include "server/endpoints/can/buses/backends.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <span>

#include "protocols/can/budget.hpp"
#include "protocols/can/formats/msgpack.hpp"
#include "server/endpoints/can/buses/send_queue.hpp"
#include "server/endpoints/can/buses/virtual_bus.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench::can {
namespace {

using Clock = ServerClock;

// A receiver with the kernel's default buffer has room for 160 datagrams.
constexpr double kBurst = 64;
constexpr double kFramesPerAnswer = 8;
constexpr auto kRetryPeriod = std::chrono::milliseconds(1);
constexpr int kReceiveBufferBytes = 4 << 20;
constexpr std::size_t kBatch = 16;

/// An IPv4 or IPv6 address with a port.
struct Address {
  sockaddr_storage storage{};

  sa_family_t family() const { return storage.ss_family; }
  socklen_t size() const { return family() == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6); }
  sockaddr* raw() { return reinterpret_cast<sockaddr*>(&storage); }
  const sockaddr* raw() const { return reinterpret_cast<const sockaddr*>(&storage); }
  sockaddr_in& v4() { return reinterpret_cast<sockaddr_in&>(storage); }
  const sockaddr_in& v4() const { return reinterpret_cast<const sockaddr_in&>(storage); }
  sockaddr_in6& v6() { return reinterpret_cast<sockaddr_in6&>(storage); }
  const sockaddr_in6& v6() const { return reinterpret_cast<const sockaddr_in6&>(storage); }

  std::uint16_t port() const { return family() == AF_INET ? v4().sin_port : v6().sin6_port; }
  bool same_host(const Address& other) const {
    if (family() != other.family()) return false;
    if (family() == AF_INET) return v4().sin_addr.s_addr == other.v4().sin_addr.s_addr;
    return std::memcmp(&v6().sin6_addr, &other.v6().sin6_addr, sizeof(in6_addr)) == 0;
  }
  std::string text() const {
    std::array<char, INET6_ADDRSTRLEN> buffer{};
    const void* bytes = family() == AF_INET ? static_cast<const void*>(&v4().sin_addr) : &v6().sin6_addr;
    return ::inet_ntop(family(), bytes, buffer.data(), buffer.size()) == nullptr ? "?" : buffer.data();
  }
};

/// The addresses that this computer has at present.
std::vector<Address> own_addresses() {
  std::vector<Address> addresses;
  ifaddrs* list = nullptr;
  if (::getifaddrs(&list) != 0) return addresses;
  for (const ifaddrs* each = list; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr == nullptr) continue;
    const sa_family_t family = each->ifa_addr->sa_family;
    if (family != AF_INET && family != AF_INET6) continue;
    Address address;
    std::memcpy(&address.storage, each->ifa_addr,
                family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6));
    addresses.push_back(address);
  }
  ::freeifaddrs(list);
  return addresses;
}

bool set_int(int fd, int level, int option, int value) {
  return ::setsockopt(fd, level, option, &value, sizeof value) == 0;
}

/// Joins the group on the interface; 0: on the interface of the routes.
bool join(int fd, const Address& group, unsigned interface) {
  if (group.family() == AF_INET) {
    ip_mreqn request{};
    request.imr_multiaddr = group.v4().sin_addr;
    request.imr_ifindex = static_cast<int>(interface);
    return ::setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request) == 0 ||
           errno == EADDRINUSE;
  }
  ipv6_mreq request{};
  request.ipv6mr_multiaddr = group.v6().sin6_addr;
  request.ipv6mr_interface = interface;
  return ::setsockopt(fd, IPPROTO_IPV6, IPV6_JOIN_GROUP, &request, sizeof request) == 0 ||
         errno == EADDRINUSE;
}

/// Keeps frames on this computer. With IPv4 they go over the loopback interface, where every program hears
/// them whatever the routes are. Loopback has no IPv6 multicast: with IPv6 they take the interface of the
/// routes, and the hop limit of 0 leaves only the copy for this computer.
bool confine(int fd, const Address& group, unsigned loopback) {
  if (group.family() == AF_INET6) return set_int(fd, IPPROTO_IPV6, IPV6_MULTICAST_HOPS, 0);
  ip_mreqn request{};
  request.imr_ifindex = static_cast<int>(loopback);
  Address source;
  source.v4().sin_family = AF_INET;
  source.v4().sin_addr.s_addr =
      htonl(INADDR_LOOPBACK);  // a route over lo may have no source, which gives 0.0.0.0
  return ::setsockopt(fd, IPPROTO_IP, IP_MULTICAST_IF, &request, sizeof request) == 0 &&
         set_int(fd, IPPROTO_IP, IP_MULTICAST_TTL, 0) && ::bind(fd, source.raw(), source.size()) == 0;
}

class UdpMulticastBus final : public VirtualBus {
 public:
  UdpMulticastBus(asio::io_context& io, const CanConfig& config)
      : VirtualBus(io, config), in_(io), out_(io), retry_(io) {}

  void send(const Frame& frame) override;
  std::string name() const override {
    return "udp_multicast:" + config_.channel + ":" + std::to_string(config_.port);
  }

 private:
  std::string open() override;
  std::string parse_group();
  std::string open_sender(unsigned loopback);
  std::string open_receiver(unsigned loopback);

  void wait();
  void read();
  void take(const msghdr& message, std::size_t size);
  bool is_from_here(const Address& sender);
  void note_losses(const msghdr& message, std::int64_t& stamp_ns);

  bool transmit(const Frame& frame);
  void flush_later();

  Address group_;
  Address own_;  ///< the source address of the frames of this bus
  asio::posix::stream_descriptor in_;
  asio::posix::stream_descriptor out_;

  SendQueue pending_;
  ServerTimer retry_;
  double allowance_ = kBurst;  ///< frames that may be sent now
  Clock::time_point allowed_at_ = Clock::now();

  std::vector<Address> hosts_;  ///< the addresses of this computer
  Clock::time_point hosts_at_{};
  LogLimit stranger_log_;
  std::uint32_t lost_before_ = 0;  ///< the socket's count of lost frames at the last look
};

// ---- opening ----

std::string UdpMulticastBus::open() {
  std::string problem = parse_group();
  const unsigned loopback = ::if_nametoindex("lo");
  if (problem.empty() && loopback == 0) problem = "this computer has no interface \"lo\"";
  if (problem.empty()) problem = open_sender(loopback);
  if (problem.empty()) problem = open_receiver(loopback);
  boost::system::error_code ignored;
  if (!problem.empty()) {
    in_.close(ignored);
    out_.close(ignored);
    return problem;
  }
  hosts_ = own_addresses();
  wait();
  return {};
}

std::string UdpMulticastBus::parse_group() {
  const char* text = config_.channel.c_str();
  if (::inet_pton(AF_INET, text, &group_.v4().sin_addr) == 1) {
    group_.v4().sin_family = AF_INET;
    group_.v4().sin_port = htons(config_.port);
    if (IN_MULTICAST(ntohl(group_.v4().sin_addr.s_addr))) return {};
  } else if (::inet_pton(AF_INET6, text, &group_.v6().sin6_addr) == 1) {
    group_.v6().sin6_family = AF_INET6;
    group_.v6().sin6_port = htons(config_.port);
    if (IN6_IS_ADDR_MULTICAST(&group_.v6().sin6_addr)) return {};
  }
  return "the channel must be a multicast address, 224.0.0.0 to 239.255.255.255 or ff00::/8";
}

std::string UdpMulticastBus::open_sender(unsigned loopback) {
  const int fd = ::socket(group_.family(), SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0 || !adopt(out_, fd)) return reason();
  // The sender has a port of its own, so that the receiver can distinguish the frames of this bus from all
  // others.
  own_ = {};
  own_.storage.ss_family = group_.family();
  socklen_t size = sizeof own_.storage;
  if (!confine(fd, group_, loopback) || ::connect(fd, group_.raw(), group_.size()) != 0 ||
      ::getsockname(fd, own_.raw(), &size) != 0) {
    return reason() + (group_.family() == AF_INET
                           ? " (is the interface \"lo\" up? ip link set lo up)"
                           : " (no route for IPv6 multicast: use an IPv4 group such as 239.74.163.2)");
  }
  return {};
}

std::string UdpMulticastBus::open_receiver(unsigned loopback) {
  const int fd = ::socket(group_.family(), SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0 || !adopt(in_, fd)) return reason();
  set_int(fd, SOL_SOCKET, SO_REUSEADDR, 1);
  // Bound to the group, so that the socket gets no other datagrams for this port.
  if (::bind(fd, group_.raw(), group_.size()) != 0) {
    return reason() + " (a program that uses this port without sharing it? ss -ulpn 'sport = :" +
           std::to_string(config_.port) + "')";
  }
  // Other programs send on the interface of the routes, if a route exists; so does this program with IPv6.
  const bool is_v4 = group_.family() == AF_INET;
  join(fd, group_, is_v4 ? 0 : loopback);
  if (!join(fd, group_, is_v4 ? loopback : 0)) return reason() + " (joining the group)";
  if (!set_int(fd, SOL_SOCKET, SO_RCVBUFFORCE, kReceiveBufferBytes))
    set_int(fd, SOL_SOCKET, SO_RCVBUF, kReceiveBufferBytes);
  set_int(fd, SOL_SOCKET, SO_TIMESTAMPNS, 1);
  set_int(fd, SOL_SOCKET, SO_RXQ_OVFL, 1);
  return {};
}

// ---- receiving ----

void UdpMulticastBus::wait() {
  in_.async_wait(asio::posix::stream_descriptor::wait_read,
                 [this, alive = alive()](const boost::system::error_code& error) {
                   if (alive.expired() || error) return;
                   read();
                   wait();
                 });
}

void UdpMulticastBus::read() {
  std::array<std::array<std::byte, 2 * kMaxMsgpackFrame>, kBatch> buffers;
  alignas(cmsghdr) std::array<std::array<std::byte, 128>, kBatch> controls;
  std::array<Address, kBatch> senders;
  std::array<iovec, kBatch> parts{};
  std::array<mmsghdr, kBatch> messages{};
  for (std::size_t i = 0; i < kBatch; ++i) {
    parts[i] = {.iov_base = buffers[i].data(), .iov_len = buffers[i].size()};
    messages[i].msg_hdr = {.msg_name = senders[i].raw(),
                           .msg_namelen = sizeof(sockaddr_storage),
                           .msg_iov = &parts[i],
                           .msg_iovlen = 1,
                           .msg_control = controls[i].data(),
                           .msg_controllen = controls[i].size(),
                           .msg_flags = 0};
  }
  const int count = ::recvmmsg(in_.native_handle(), messages.data(), kBatch, MSG_DONTWAIT, nullptr);
  for (int i = 0; i < count; ++i) {
    const mmsghdr& message = messages[static_cast<std::size_t>(i)];
    take(message.msg_hdr, message.msg_len);
  }
}

void UdpMulticastBus::take(const msghdr& message, std::size_t size) {
  const auto& sender = *static_cast<const Address*>(message.msg_name);
  std::int64_t stamp_ns = 0;
  note_losses(message, stamp_ns);
  if (sender.port() == own_.port() && sender.same_host(own_)) return;
  if (!is_from_here(sender)) return;
  const std::span bytes(static_cast<const std::byte*>(message.msg_iov->iov_base), size);
  const auto frame = (message.msg_flags & MSG_TRUNC) != 0 ? std::nullopt : decode_msgpack(bytes);
  if (!frame) {
    ++status_.malformed;
    return;
  }
  allowance_ = std::min(allowance_ + kFramesPerAnswer, kBurst);
  deliver(*frame, stamp_ns);
}

void UdpMulticastBus::note_losses(const msghdr& message, std::int64_t& stamp_ns) {
  auto* header = const_cast<msghdr*>(&message);  // the macros take no const pointer
  for (cmsghdr* each = CMSG_FIRSTHDR(header); each != nullptr; each = CMSG_NXTHDR(header, each)) {
    if (each->cmsg_level != SOL_SOCKET) continue;
    if (each->cmsg_type == SO_TIMESTAMPNS) {
      timespec time{};
      std::memcpy(&time, CMSG_DATA(each), sizeof time);
      stamp_ns = std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
    } else if (each->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t lost = 0;
      std::memcpy(&lost, CMSG_DATA(each), sizeof lost);
      status_.receive_dropped += lost - lost_before_;
      lost_before_ = lost;
    }
  }
}

/// Every computer of the local network can send to a multicast group. Frames of other computers are dropped.
/// Programs of this computer send from 0.0.0.0 if the route goes over lo; the kernel drops such frames of
/// other computers.
bool UdpMulticastBus::is_from_here(const Address& sender) {
  if (sender.family() == AF_INET && sender.v4().sin_addr.s_addr == htonl(INADDR_ANY)) return true;
  const auto is_known = [&] {
    return std::ranges::any_of(hosts_, [&](const Address& host) { return host.same_host(sender); });
  };
  if (is_known()) return true;
  const Clock::time_point now = Clock::now();
  if (now - hosts_at_ > std::chrono::seconds(1)) {
    hosts_at_ = now;
    hosts_ = own_addresses();
    if (is_known()) return true;
  }
  if (stranger_log_.allow())
    log::warn("{}: ignores what {} sends, which is not this computer", name(), sender.text());
  return false;
}

// ---- sending ----

void UdpMulticastBus::send(const Frame& frame) {
  if (!is_up()) {
    ++status_.send_dropped;
  } else if (!pending_.empty()) {
    status_.send_dropped += pending_.push(frame);  // keeps the order
  } else if (!transmit(frame)) {
    status_.send_dropped += pending_.push(frame);
    flush_later();
  }
}

/// Sends the frame if the rate allows it; false if it must wait.
bool UdpMulticastBus::transmit(const Frame& frame) {
  const Clock::time_point now = Clock::now();
  const double elapsed_s = std::chrono::duration<double>(now - allowed_at_).count();
  allowed_at_ = now;
  allowance_ = std::min(allowance_ + elapsed_s * row_of(Backend::kUdpMulticast).frames_per_s, kBurst);
  if (allowance_ < 1.0) return false;
  std::array<std::byte, kMaxMsgpackFrame> bytes;
  const std::size_t size = encode_msgpack(frame, realtime_s(), bytes);
  if (::send(out_.native_handle(), bytes.data(), size, MSG_DONTWAIT) >= 0) {
    allowance_ -= 1.0;
    ++status_.sent;
    return true;
  }
  if (errno == EAGAIN || errno == ENOBUFS) return false;
  ++status_.send_dropped;
  return true;
}

void UdpMulticastBus::flush_later() {
  retry_.expires_after(kRetryPeriod);
  retry_.async_wait([this, alive = alive()](const boost::system::error_code& error) {
    if (alive.expired() || error) return;
    while (!pending_.empty() && transmit(pending_.front()))
      pending_.pop();
    if (!pending_.empty()) flush_later();
  });
}

}  // namespace

std::unique_ptr<Bus> make_udp_multicast_bus(asio::io_context& io, const CanConfig& config) {
  auto bus = std::make_unique<UdpMulticastBus>(io, config);
  bus->start();
  return bus;
}

}  // namespace drivebench::can
