#pragma once

#include <memory>

#include "server/endpoints/can/buses/bus.hpp"

namespace drivebench::can {

/// A server of the protocol of socketcand, for python-can and SavvyCAN: config names a loopback address
/// (the protocol knows no password) and a port. Every client in raw mode gets the frames of the bench and of
/// the other clients; one that reads nothing for 2 s is cut off. Throws std::runtime_error if it cannot be
/// had and is required.
///
/// It has one bus, which answers to every name. Raw and control mode, echo and statistics work; the broadcast
/// manager's jobs and filters and ISO-TP are refused.
std::unique_ptr<Bus> make_socketcand_bus(boost::asio::io_context& io, const CanConfig& config);

}  // namespace drivebench::can
