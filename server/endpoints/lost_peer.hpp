#pragma once

#include "server/host/asio.hpp"

namespace drivebench {

/// How long a peer may acknowledge nothing before the kernel gives its connection up.
inline constexpr int kUserTimeoutMs = 3000;

/// Whether a connection has been given up so. Where a router or the own host told meanwhile that the peer
/// cannot be reached, the kernel gives that as the reason.
inline bool is_given_up(const boost::system::error_code& error) noexcept {
  return error == asio::error::timed_out || error == asio::error::host_unreachable ||
         error == asio::error::network_unreachable;
}

}  // namespace drivebench
