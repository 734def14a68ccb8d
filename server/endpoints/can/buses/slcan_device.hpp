#pragma once

#include <memory>

#include "server/endpoints/can/buses/bus.hpp"

namespace drivebench::can {

/// make_slcan_bus() for a serial adapter. Opens the device again after it was removed and plugged in.
std::unique_ptr<Bus> make_slcan_device(boost::asio::io_context& io, const CanConfig& config);

}  // namespace drivebench::can
