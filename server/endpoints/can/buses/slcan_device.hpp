#pragma once

#include <memory>

#include "server/endpoints/can/buses/bus.hpp"

namespace drivebench::can {

/// The case of make_slcan_bus() where config.channel is a serial adapter. Opens the device again when it
/// comes back after it was pulled out.
std::unique_ptr<Bus> make_slcan_device(boost::asio::io_context& io, const CanConfig& config);

}  // namespace drivebench::can
