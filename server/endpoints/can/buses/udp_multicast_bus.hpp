#pragma once

#include <memory>

#include "server/endpoints/can/buses/bus.hpp"

namespace drivebench::can {

/// The virtual bus of python-can's interface "udp_multicast" between the programs of one computer: config
/// names a multicast group (IPv4 or IPv6) and a port, which are the bus. Hop limit 0 and a check of every
/// sender keep it on this computer. Throws std::runtime_error if it cannot be had and is required.
///
/// Nobody says when a receiver's buffer is full, and then frames are lost silently. So it sends at most
/// 64 frames at once and 8 per millisecond, as many as a busy bus at 1 Mbit/s carries, and 8 more for each
/// frame that comes in, so that an exchange of question and answer is not held up.
std::unique_ptr<Bus> make_udp_multicast_bus(boost::asio::io_context& io, const CanConfig& config);

}  // namespace drivebench::can
