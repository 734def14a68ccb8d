#pragma once

#include <memory>

#include "server/endpoints/can/buses/bus.hpp"

namespace drivebench::can {

/// A bus over the ASCII protocol of serial CAN adapters. Throws std::runtime_error if it cannot be had and is
/// required. config.channel says what it is:
///
///   tcp:ADDRESS:PORT   listens there; loopback addresses only, because the protocol knows no password
///   pty:PATH           a terminal, with a link to it at PATH
///   /dev/ttyACM0@BAUD  a serial adapter, at 115200 baud unless it says otherwise
///
/// With the first two the clients see an adapter, each its own and all of them on one bus: frames flow
/// between O or L and C. A client that does not read fast enough gets the newest frame of each identifier.
/// With the third we are the client, at the bit rates of the configuration; adapters often leave them to us
/// but know only a few of them.
std::unique_ptr<Bus> make_slcan_bus(boost::asio::io_context& io, const CanConfig& config);

}  // namespace drivebench::can
