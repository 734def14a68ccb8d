#include <cstdlib>

#include "server/endpoints/can/buses/backends.hpp"

namespace drivebench::can {

std::unique_ptr<Bus> open_bus(boost::asio::io_context& io, const CanConfig& config) {
  for (const BusMaker& maker : kBusMakers) {
    if (maker.backend == config.backend) return maker.make(io, config);
  }
  std::abort();  // the configuration accepts no other back end
}

}  // namespace drivebench::can
