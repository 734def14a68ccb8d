#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "protocols/can/backends.hpp"
#include "protocols/can/profile.hpp"

namespace drivebench::link {

/// An axis on a CAN bus, with the settings on which both ends must agree.
struct CanAddress {
  can::Backend backend = can::Backend::kUdpMulticast;
  /// socketcan: the interface; udp_multicast: the group; slcan: path of a terminal or "tcp:HOST:PORT";
  /// socketcand: "HOST:PORT".
  std::string channel;
  std::uint16_t port = 0;                   ///< udp_multicast
  std::string bus = "can0";                 ///< socketcand: the bus to open
  std::uint32_t bit_rate = 1'000'000;       ///< slcan: set in the adapter
  std::uint32_t data_bit_rate = 5'000'000;  ///< slcan: set in the adapter, for the data phase
  std::uint32_t node = 1;
  can::Profile profile;
};

/// Whether the text begins like a CAN address.
bool is_can_address(std::string_view text) noexcept;

/// `can:BACKEND:CHANNEL[?KEY=VALUE&...]`, for example `can:socketcan:vcan0?node=2&fd=0&command=0x210`. Keys:
/// node, fd, extended, identifiers (free, canopen), bus, bit_rate, data_bit_rate, the names of the messages
/// (their base identifiers) and of the units of can::Profile. Throws AddressError.
CanAddress parse_can_address(std::string_view text);

/// The mode of a command with these gates, in the numbers of the profile.
unsigned can_mode_of(v1::Gates gates) noexcept;

/// Without keys: "can:socketcan:vcan0".
std::string to_string(const CanAddress& address);

}  // namespace drivebench::link
