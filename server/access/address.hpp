#pragma once

#include <string>
#include <string_view>

#include "server/engine/owners.hpp"

namespace drivebench {

/// The address of every client on a unix socket.
inline constexpr std::string_view kUnixAddress = "unix";

/// The address for which a limit counts the client: without the port; of IPv6 the network (/64), which is
/// what one computer has. Clients of a transport without addresses have one together, the name of the
/// transport.
std::string address_of(const Client& client);

}  // namespace drivebench
