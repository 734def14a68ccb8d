#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "clients/link/can/can_address.hpp"
#include "clients/link/can/can_bus.hpp"

namespace drivebench::link {

/// The client side of a back end of can::kBackends. Each kind has a file of its own and a row in the table of
/// can_bus.cpp, which reads addresses and opens buses.
struct CanBusKind {
  can::Backend backend;
  /// Sets the channel, and the port if there is one. Gives the rule that the text breaks; empty: none.
  std::string (*read_channel)(std::string_view text, CanAddress& address);
  /// As open_can_bus().
  std::unique_ptr<CanBus> (*open)(const CanAddress& address, std::chrono::milliseconds deadline,
                                  std::span<const std::uint32_t> ids);
};

extern const CanBusKind kSocketCan;
extern const CanBusKind kUdpMulticast;
extern const CanBusKind kSlcan;
extern const CanBusKind kSocketcand;

const CanBusKind& bus_kind(can::Backend backend);

}  // namespace drivebench::link
