#include "clients/command/can/can_netlink.hpp"

#include <linux/can/netlink.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <system_error>
#include <vector>

#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::command {
namespace {

using Bytes = std::span<const std::byte>;

/// The start of the bytes as a structure of the kernel; missing bytes are zero, because the structure may be
/// older than ours.
template <class T>
T read_as(Bytes bytes) {
  T value{};
  std::ranges::copy(bytes.first(std::min(sizeof value, bytes.size())),
                    std::as_writable_bytes(std::span(&value, 1)).begin());
  return value;
}

constexpr std::size_t aligned(std::size_t size) {
  return (size + NLA_ALIGNTO - 1) & ~std::size_t{NLA_ALIGNTO - 1};
}

/// The attributes in a block, by type.
std::map<int, Bytes> attributes_in(Bytes bytes) {
  std::map<int, Bytes> found;
  while (bytes.size() >= sizeof(nlattr)) {
    const auto head = read_as<nlattr>(bytes);
    if (head.nla_len < sizeof(nlattr) || head.nla_len > bytes.size()) break;
    found[head.nla_type & NLA_TYPE_MASK] = bytes.subspan(sizeof(nlattr), head.nla_len - sizeof(nlattr));
    bytes = bytes.subspan(std::min(aligned(head.nla_len), bytes.size()));
  }
  return found;
}

std::string text_of(Bytes bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    if (byte == std::byte{0}) break;
    text += std::to_integer<char>(byte);
  }
  return text;
}

std::optional<CanBitTiming> timing_of(const std::map<int, Bytes>& attributes, int type) {
  const auto found = attributes.find(type);
  if (found == attributes.end()) return std::nullopt;
  const auto raw = read_as<can_bittiming>(found->second);
  if (raw.bitrate == 0) return std::nullopt;
  return CanBitTiming{.bit_rate = raw.bitrate,
                      .sample_point = raw.sample_point / 1000.0,
                      .sjw = raw.sjw,
                      .quanta = 1 + raw.prop_seg + raw.phase_seg1 + raw.phase_seg2};
}

CanController controller_of(const std::map<int, Bytes>& data) {
  CanController controller;
  const auto at = [&](int type) { return data.contains(type) ? data.at(type) : Bytes{}; };
  controller.timing = timing_of(data, IFLA_CAN_BITTIMING);
  controller.data_timing = timing_of(data, IFLA_CAN_DATA_BITTIMING);
  if (const auto state = read_as<std::uint32_t>(at(IFLA_CAN_STATE)); state < CAN_STATE_MAX) {
    controller.state = static_cast<CanControllerState>(state);
  }
  const auto mode = read_as<can_ctrlmode>(at(IFLA_CAN_CTRLMODE));
  controller.fd = (mode.flags & CAN_CTRLMODE_FD) != 0;
  controller.listen_only = (mode.flags & CAN_CTRLMODE_LISTENONLY) != 0;
  controller.one_shot = (mode.flags & CAN_CTRLMODE_ONE_SHOT) != 0;
  controller.restart_ms = read_as<std::uint32_t>(at(IFLA_CAN_RESTART_MS));
  return controller;
}

std::vector<std::byte> link_request(const std::string& name) {
  nlmsghdr head{};
  const ifinfomsg body{};
  nlattr attribute{};
  attribute.nla_type = IFLA_IFNAME;
  attribute.nla_len = static_cast<std::uint16_t>(sizeof attribute + name.size() + 1);
  std::vector<std::byte> request(sizeof head + sizeof body + aligned(attribute.nla_len));
  head.nlmsg_type = RTM_GETLINK;
  head.nlmsg_flags = NLM_F_REQUEST;
  head.nlmsg_len = static_cast<std::uint32_t>(request.size());
  std::byte* to = request.data();
  std::memcpy(to, &head, sizeof head);
  std::memcpy(to += sizeof head, &body, sizeof body);
  std::memcpy(to += sizeof body, &attribute, sizeof attribute);
  std::memcpy(to + sizeof attribute, name.data(), name.size());
  return request;
}

[[noreturn]] void fail(int error) {
  throw std::system_error(error, std::generic_category(), "asking the kernel for an interface");
}

}  // namespace

std::optional<CanInterface> parse_link_message(Bytes message) {
  const auto head = read_as<nlmsghdr>(message);
  constexpr std::size_t kFixed = sizeof(nlmsghdr) + sizeof(ifinfomsg);
  if (message.size() < kFixed || head.nlmsg_type != RTM_NEWLINK) return std::nullopt;
  if (head.nlmsg_len < kFixed || head.nlmsg_len > message.size()) return std::nullopt;
  const auto body = read_as<ifinfomsg>(message.subspan(sizeof head));
  const auto attributes = attributes_in(message.subspan(kFixed, head.nlmsg_len - kFixed));
  const auto at = [&](int type) { return attributes.contains(type) ? attributes.at(type) : Bytes{}; };

  CanInterface interface;
  interface.name = text_of(at(IFLA_IFNAME));
  interface.is_can = body.ifi_type == ARPHRD_CAN;
  interface.up = (body.ifi_flags & IFF_UP) != 0;
  interface.mtu = read_as<std::uint32_t>(at(IFLA_MTU));
  interface.queue_length = read_as<std::uint32_t>(at(IFLA_TXQLEN));
  const auto info = attributes_in(at(IFLA_LINKINFO));
  if (const auto kind = info.find(IFLA_INFO_KIND); kind != info.end()) interface.kind = text_of(kind->second);
  if (const auto data = info.find(IFLA_INFO_DATA); data != info.end() && interface.kind == "can") {
    interface.controller = controller_of(attributes_in(data->second));
  }
  return interface;
}

std::optional<CanInterface> read_can_interface(const std::string& name) {
  if (name.empty() || name.size() >= IFNAMSIZ) return std::nullopt;
  const link::FileDescriptor socket(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  if (!socket.is_open()) fail(errno);
  const timeval patience = {.tv_sec = 5, .tv_usec = 0};
  if (::setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) != 0) fail(errno);
  const std::vector<std::byte> request = link_request(name);
  if (::send(socket.get(), request.data(), request.size(), 0) < 0) fail(errno);
  std::vector<std::byte> answer(1 << 16);
  const ssize_t size = ::recv(socket.get(), answer.data(), answer.size(), 0);
  if (size < 0) fail(errno);
  answer.resize(static_cast<std::size_t>(size));
  if (read_as<nlmsghdr>(answer).nlmsg_type == NLMSG_ERROR &&
      answer.size() >= sizeof(nlmsghdr) + sizeof(int)) {
    const int error = -read_as<int>(Bytes(answer).subspan(sizeof(nlmsghdr)));
    if (error == ENODEV) return std::nullopt;
    fail(error);
  }
  return parse_link_message(answer);
}

}  // namespace drivebench::command
