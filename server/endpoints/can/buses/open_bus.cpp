#include <cstdlib>

#include "server/endpoints/can/buses/bus.hpp"
#include "server/endpoints/can/buses/slcan_bus.hpp"
#include "server/endpoints/can/buses/socketcan_bus.hpp"
#include "server/endpoints/can/buses/socketcand_bus.hpp"
#include "server/endpoints/can/buses/udp_multicast_bus.hpp"

namespace drivebench::can {

std::unique_ptr<Bus> open_bus(asio::io_context& io, const CanConfig& config) {
  switch (config.backend) {
    case CanBackend::kSocketCan:
      return std::make_unique<SocketCanBus>(io, config);
    case CanBackend::kUdpMulticast:
      return make_udp_multicast_bus(io, config);
    case CanBackend::kSlcan:
      return make_slcan_bus(io, config);
    case CanBackend::kSocketcand:
      return make_socketcand_bus(io, config);
  }
  std::abort();  // config.cpp knows no other
}

}  // namespace drivebench::can
