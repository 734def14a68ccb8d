#include "clients/link/can/can_bus.hpp"

#include <algorithm>
#include <array>

#include "clients/link/can/can_bus_kind.hpp"

namespace drivebench::link {

const CanBusKind& bus_kind(can::Backend backend) {
  static constexpr std::array kKinds = {&kSocketCan, &kUdpMulticast, &kSlcan, &kSocketcand};
  static_assert(kKinds.size() == can::kBackends.size());
  return **std::ranges::find(kKinds, backend, &CanBusKind::backend);
}

std::unique_ptr<CanBus> open_can_bus(const CanAddress& address, std::chrono::milliseconds deadline,
                                     std::span<const std::uint32_t> ids) {
  return bus_kind(address.backend).open(address, deadline, ids);
}

}  // namespace drivebench::link
