#pragma once

#include <array>
#include <memory>

#include "protocols/can/backends.hpp"
#include "server/endpoints/can/buses/bus.hpp"

/// The back ends that open_bus() knows. Each throws std::runtime_error if the bus cannot be had and is
/// required.
namespace drivebench::can {

using MakeBus = std::unique_ptr<Bus>(boost::asio::io_context& io, const CanConfig& config);

/// A CAN interface of the kernel.
MakeBus make_socketcan_bus;

/// The virtual bus of python-can's interface "udp_multicast" between the programs of one computer: config
/// names a multicast group (IPv4 or IPv6) and a port, which are the bus. Hop limit 0 and a check of every
/// sender keep it on this computer.
///
/// A full buffer of a receiver tells no sender, and then frames are lost silently. So it sends at most
/// 64 frames at once and 8 per millisecond, as many as a busy bus at 1 Mbit/s carries, and 8 more for each
/// frame that comes in, so that an exchange of question and answer is not held up.
MakeBus make_udp_multicast_bus;

/// A bus over the ASCII protocol of serial CAN adapters. config.channel says what it is:
///
///   tcp:ADDRESS:PORT   listens there; loopback addresses only, because the protocol knows no password
///   pty:PATH           a terminal, with a link to it at PATH
///   /dev/ttyACM0@BAUD  a serial adapter, at 115200 baud unless it says otherwise
///
/// With the first two the clients see an adapter, each its own and all of them on one bus: frames flow
/// between O or L and C. A client that does not read fast enough gets the newest frame of each identifier.
/// With the third the bench is the client, at the bit rates of the configuration; adapters often leave them
/// to the client but know only a few of them.
MakeBus make_slcan_bus;

/// A server of the protocol of socketcand, for python-can and SavvyCAN: config names a loopback address
/// (the protocol knows no password) and a port. Every client in raw mode gets the frames of the bench and of
/// the other clients; one that reads nothing for 2 s is cut off.
///
/// It has one bus, which answers to every name. Raw and control mode, echo and statistics work; the broadcast
/// manager's jobs and filters and ISO-TP are refused.
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
