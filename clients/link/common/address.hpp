#pragma once

#include <chrono>
#include <stdexcept>
#include <string>
#include <string_view>

#include "clients/link/common/file_descriptor.hpp"
#include "clients/link/common/tls_tunnel.hpp"

namespace drivebench::link {

/// The link failed and is closed: the peer left, fell silent or does not speak the protocol.
class LinkError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Nothing answers at the address.
class ConnectError : public LinkError {
 public:
  using LinkError::LinkError;
};

/// The text is not an address.
class AddressError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

inline constexpr std::string_view kDefaultAddress = "tcp:127.0.0.1:7300";

/// The address of a bench: `tcp:HOST:PORT`, `HOST:PORT` (an IPv6 host in brackets; without a port 7300),
/// `tls:HOST:PORT?ca=FILE&certificate=FILE&key=FILE` (each file may be left out), `unix:PATH`, or `shm:PATH`:
/// the unix socket of the bench, and exchanges through shared memory. All but tls: may end in `?spin_us=N`.
struct Address {
  std::string host;
  std::string port;
  std::string path;  ///< of a unix socket; then host and port are empty
  bool tls = false;
  TlsFiles files{};
  bool shares_memory = false;
  /// For so long this side looks for an answer before it sleeps; with shared memory both sides.
  std::chrono::microseconds spin{0};
};

inline constexpr unsigned kMaxSocketSpinUs = 1000;

/// Throws AddressError.
Address parse_address(std::string_view text);

/// `tcp:HOST:PORT`, `tls:HOST:PORT` without the files, `unix:PATH` or `shm:PATH`.
std::string to_string(const Address& address);

/// Returns a connected, blocking stream socket without Nagle's delay; for a tls: address it leads through a
/// tunnel. Throws ConnectError.
FileDescriptor connect_to(const Address& address, std::chrono::milliseconds deadline);

}  // namespace drivebench::link
