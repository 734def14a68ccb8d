#pragma once

#include <linux/can.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "clients/link/common/file_descriptor.hpp"
#include "protocols/can/frame.hpp"

namespace drivebench::speed {

using Bytes = std::span<const std::byte>;

/// A CAN bus, or a carrier of its datagrams, with blocking calls and nothing in between.
class CanWire {
 public:
  /// The bus of python-can: every program sends to a group on the loopback interface and hears it, the sender
  /// too.
  static CanWire multicast(const std::string& group, std::uint16_t port);
  /// Two ends that hear each other only.
  static std::pair<CanWire, CanWire> unicast();
  /// An interface of the kernel.
  static CanWire socketcan(const std::string& interface);

  void send(Bytes datagram);
  /// The next foreign datagram, valid until the next call. Throws when none comes for long.
  Bytes receive();

  /// A frame as a datagram, valid until the next call, and back; nothing if it is none.
  Bytes datagram_of(const can::Frame& frame);
  std::optional<can::Frame> frame_of(Bytes datagram) const;

 private:
  bool is_kernel_can_ = false;
  link::FileDescriptor in_;
  link::FileDescriptor out_;    ///< kernel CAN: not open, `in_` is for both
  std::uint16_t own_port_ = 0;  ///< source port of our datagrams (network order); 0: they do not come back
  std::array<std::byte, sizeof(canfd_frame)> raw_{};
  std::array<std::byte, 256> encoded_{};
  std::array<std::byte, 512> received_{};
};

/// A free UDP port of the loopback interface.
std::uint16_t free_udp_port();

/// Whether this kernel has an interface of this name and CAN sockets.
bool has_can(const std::string& interface);

}  // namespace drivebench::speed
