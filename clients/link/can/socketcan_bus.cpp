#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>

#include <thread>
#include <vector>

#include "clients/link/can/bus_socket.hpp"
#include "clients/link/can/can_bus_kind.hpp"
#include "protocols/can/formats/kernel_frame.hpp"

namespace drivebench::link {
namespace {

using namespace std::chrono_literals;
using can::Frame;
using Clock = CanBus::Clock;

/// The kernel's CAN.
class SocketCanBus final : public CanBus {
 public:
  SocketCanBus(const CanAddress& address, std::span<const std::uint32_t> ids)
      : name_(to_string(address)), fd_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    if (!fd_.is_open()) throw ConnectError("this system has no CAN sockets: " + reason());
    try {
      set_option(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1);
      if (ids.empty()) {
        set_option(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, can_err_mask_t{CAN_ERR_MASK});
      } else {
        filter(ids);
      }
      sockaddr_can here = {};
      here.can_family = AF_CAN;
      here.can_ifindex = static_cast<int>(::if_nametoindex(address.channel.c_str()));
      if (here.can_ifindex == 0 ||
          ::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0) {
        throw ConnectError(reason());
      }
    } catch (const ConnectError& error) {
      throw ConnectError("there is no " + name_ + ": " + error.what());
    }
    set_patience(fd_);
  }

  void send(const Frame& frame) override {
    const canfd_frame out = can::raw_of(frame);
    const std::size_t size = frame.fd ? CANFD_MTU : CAN_MTU;
    // A full queue empties at the speed of the bus; poll() reports it as writable nevertheless.
    for (const Clock::time_point give_up = Clock::now() + 1s; ::write(fd_.get(), &out, size) < 0;) {
      if (errno == EINTR) continue;
      if (errno != ENOBUFS || Clock::now() > give_up) throw LinkError(name_ + " failed: " + reason());
      std::this_thread::sleep_for(1ms);
    }
  }

  std::optional<Frame> receive(Clock::time_point until) override {
    canfd_frame in = {};
    const std::size_t size =
        receive_datagram(name_, until, [&](int flags) { return ::recv(fd_.get(), &in, sizeof in, flags); });
    if (size != CAN_MTU && size != CANFD_MTU) return std::nullopt;
    if (in.len > (size == CANFD_MTU ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) return std::nullopt;
    return can::frame_of(in, size == CANFD_MTU);
  }

 private:
  void filter(std::span<const std::uint32_t> ids) {
    const std::vector<can_filter> filters = can::filters_for({ids.begin(), ids.end()});
    if (::setsockopt(fd_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                     static_cast<socklen_t>(filters.size() * sizeof(can_filter))) != 0) {
      throw ConnectError(reason());
    }
  }

  std::string name_;
  FileDescriptor fd_;
};

}  // namespace

constinit const CanBusKind kSocketCan = {
    .backend = can::Backend::kSocketCan,
    .read_channel = [](std::string_view text, CanAddress& address) -> std::string {
      if (text.empty() || text.size() >= IFNAMSIZ) {
        return "after socketcan: comes the name of an interface, at most 15 characters";
      }
      address.channel = text;
      return {};
    },
    .open = [](const CanAddress& address, std::chrono::milliseconds, std::span<const std::uint32_t> ids)
        -> std::unique_ptr<CanBus> { return std::make_unique<SocketCanBus>(address, ids); }};

}  // namespace drivebench::link
