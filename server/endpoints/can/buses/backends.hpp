#pragma once

#include <array>
#include <memory>

#include "protocols/can/backends.hpp"
#include "server/endpoints/can/buses/bus.hpp"

/// The back ends of open_bus(). Each throws std::runtime_error if a required bus cannot be opened.
namespace drivebench::can {

using MakeBus = std::unique_ptr<Bus>(boost::asio::io_context& io, const CanConfig& config);

/// A CAN interface of the kernel.
MakeBus make_socketcan_bus;

/// The virtual bus of python-can's interface "udp_multicast" between the programs of one computer: config
/// names a multicast group (IPv4 or IPv6) and a port, which are the bus. Hop limit 0 and a check of every
/// sender keep it on this computer.
///
/// When a receiver's buffer is full, frames are lost without notice. So the bus sends at most 64 frames at
/// once and 8 per millisecond, as many as a busy bus at 1 Mbit/s carries, and 8 more for each received frame,
/// so that exchanges of command and answer do not wait.
MakeBus make_udp_multicast_bus;

/// A bus over the ASCII protocol of serial CAN adapters. config.channel is one of:
///
///   tcp:ADDRESS:PORT   listens there; loopback addresses only, because the protocol has no password
///   pty:PATH           a terminal, with a link to it at PATH
///   /dev/ttyACM0@BAUD  a serial adapter, at 115200 baud unless it says otherwise
///
/// With the first two, each client gets an adapter of its own on a common bus; frames flow between the
/// commands O or L and C. A slow client gets the newest frame of each identifier. With the third the bench is
/// the client and sets the bit rates of the configuration; an adapter supports only some of them.
MakeBus make_slcan_bus;

/// A server of the protocol of socketcand, for python-can and SavvyCAN: config names a loopback address (the
/// protocol has no password) and a port. Every client in raw mode gets the frames of the bench and of the
/// other clients; a client that reads nothing for 2 s is cut off.
///
/// The server has one bus, which has every name. Raw and control mode, echo and statistics work; the jobs and
/// filters of the broadcast manager and ISO-TP are refused.
MakeBus make_socketcand_bus;

struct BusMaker {
  Backend backend;
  MakeBus* make;
};
inline constexpr auto kBusMakers = std::to_array<BusMaker>({
    {Backend::kSocketCan, make_socketcan_bus},
    {Backend::kUdpMulticast, make_udp_multicast_bus},
    {Backend::kSlcan, make_slcan_bus},
    {Backend::kSocketcand, make_socketcand_bus},
});
static_assert(kBusMakers.size() == kBackends.size());

}  // namespace drivebench::can
