#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace drivebench::web {

/// The gateway cannot start so; what() names option, value and rule.
class StartError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Where the gateway listens.
struct ListenAddress {
  std::string host;  ///< an IP address, without brackets
  std::uint16_t port = 0;
  bool is_loopback = false;
};

/// `ADDRESS:PORT`, for example `127.0.0.1:7380`, `localhost:0` or `[::1]:7380`; port 0: the system chooses
/// one. Throws StartError.
ListenAddress parse_listen_address(std::string_view text);

/// `127.0.0.1:7380`, as a browser writes it.
std::string to_string(const ListenAddress& address);

}  // namespace drivebench::web
