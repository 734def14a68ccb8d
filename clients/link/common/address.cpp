#include "clients/link/common/address.hpp"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "protocols/shm/segment.hpp"

namespace drivebench::link {
namespace {

[[noreturn]] void bad_address(std::string_view text, std::string_view rule) {
  throw AddressError("'" + std::string(text) + "' is not an address: " + std::string(rule));
}

/// The number that the text is; nothing if it is none.
std::optional<unsigned> number_in(std::string_view text) {
  unsigned value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

bool is_port(std::string_view text) {
  const unsigned port = number_in(text).value_or(0);
  return port >= 1 && port <= 65535;
}

std::string socket_path(std::string_view text, std::string_view path) {
  if (path.empty()) {
    bad_address(text,
                "after " + std::string(text.substr(0, text.find(':'))) + ": comes the path of a socket");
  }
  if (path.size() >= sizeof(sockaddr_un::sun_path)) {
    bad_address(text, "the path of a unix socket has at most 107 bytes");
  }
  return std::string(path);
}

constexpr std::string_view kSpin = "?spin_us=";

/// Takes `?spin_us=N` off the end of a place; nothing: there is no `?`.
std::optional<std::chrono::microseconds> take_spin(std::string_view text, std::string_view& place,
                                                   unsigned largest_us) {
  const std::size_t mark = place.rfind('?');
  if (mark == std::string_view::npos) return std::nullopt;
  const std::string_view option = place.substr(mark);
  const auto spin_us =
      option.starts_with(kSpin) ? number_in(option.substr(kSpin.size())) : std::optional<unsigned>{};
  if (!spin_us || *spin_us > largest_us)
    bad_address(text, "behind the ? stands spin_us=N with N from 0 to " + std::to_string(largest_us));
  place = place.substr(0, mark);
  return std::chrono::microseconds(*spin_us);
}

/// Parses the part of a shm: address behind the colon.
Address shm_address(std::string_view text, std::string_view place) {
  Address address{.host = {}, .port = {}, .path = {}, .shares_memory = true};
  address.spin = take_spin(text, place, shm::kMaxSpinUs).value_or(std::chrono::microseconds(20));
  address.path = socket_path(text, place);
  return address;
}

/// Parses the part of a unix: address behind the colon.
Address unix_address(std::string_view text, std::string_view place) {
  Address address{.host = {}, .port = {}, .path = {}};
  if (place.find(kSpin) != std::string_view::npos)  // another ? is one of the path
    address.spin = *take_spin(text, place, kMaxSocketSpinUs);
  address.path = socket_path(text, place);
  return address;
}

/// Parses the part of a tls: address behind the question mark.
TlsFiles files_in(std::string_view text, std::string_view query) {
  TlsFiles files;
  while (!query.empty()) {
    const std::size_t end = std::min(query.find('&'), query.size());
    const std::string_view part = query.substr(0, end);
    const std::size_t equals = std::min(part.find('='), part.size());
    const std::string_view name = part.substr(0, equals);
    std::string* const file = name == "ca"            ? &files.ca
                              : name == "certificate" ? &files.certificate
                              : name == "key"         ? &files.key
                                                      : nullptr;
    if (file == nullptr || equals + 1 >= part.size()) {
      bad_address(text, "behind the ? stand ca=FILE, certificate=FILE and key=FILE, with & between them");
    }
    *file = part.substr(equals + 1);
    query = query.substr(std::min(end + 1, query.size()));
  }
  if (files.certificate.empty() != files.key.empty()) {
    bad_address(text, "certificate and key are given together or not at all");
  }
  return files;
}

std::string reason(int error) {
  return std::generic_category().message(error);
}

/// Returns 0 or an error number.
int connect_within(int fd, const sockaddr* peer, socklen_t size, std::chrono::milliseconds deadline) {
  if (::connect(fd, peer, size) != 0 && errno != EINPROGRESS) return errno;
  pollfd waiting = {.fd = fd, .events = POLLOUT, .revents = 0};
  int ready = 0;
  do {
    ready = ::poll(&waiting, 1, static_cast<int>(deadline.count()));
  } while (ready < 0 && errno == EINTR);
  if (ready == 0) return ETIMEDOUT;
  int error = 0;
  socklen_t error_size = sizeof error;
  if (::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &error_size) != 0) return errno;
  if (error == 0) ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL) & ~O_NONBLOCK);
  return error;
}

FileDescriptor new_socket(int family) {
  return FileDescriptor(::socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

FileDescriptor connect_unix(const Address& address, std::chrono::milliseconds deadline) {
  sockaddr_un peer = {};
  peer.sun_family = AF_UNIX;
  address.path.copy(peer.sun_path, sizeof peer.sun_path - 1);
  FileDescriptor fd = new_socket(AF_UNIX);
  const int error =
      fd.is_open() ? connect_within(fd.get(), reinterpret_cast<const sockaddr*>(&peer), sizeof peer, deadline)
                   : errno;
  if (error != 0) throw ConnectError("nothing answers at " + to_string(address) + ": " + reason(error));
  return fd;
}

FileDescriptor connect_tcp(const Address& address, std::chrono::milliseconds deadline) {
  addrinfo hints = {};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(address.host.c_str(), address.port.c_str(), &hints, &found);
      error != 0) {
    throw ConnectError("no such host: " + address.host + " (" + ::gai_strerror(error) + ")");
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> list(found, &::freeaddrinfo);
  int error = 0;
  for (const addrinfo* peer = list.get(); peer != nullptr; peer = peer->ai_next) {
    FileDescriptor fd = new_socket(peer->ai_family);
    error = fd.is_open() ? connect_within(fd.get(), peer->ai_addr, peer->ai_addrlen, deadline) : errno;
    if (error != 0) continue;
    const int on = 1;
    ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return fd;
  }
  throw ConnectError("nothing answers at " + to_string(address) + ": " + reason(error));
}

}  // namespace

Address parse_address(std::string_view text) {
  constexpr std::string_view kUnix = "unix:";
  constexpr std::string_view kShm = "shm:";
  constexpr std::string_view kTcp = "tcp:";
  if (text.starts_with(kUnix)) return unix_address(text, text.substr(kUnix.size()));
  if (text.starts_with(kShm)) return shm_address(text, text.substr(kShm.size()));
  constexpr std::string_view kTls = "tls:";
  Address address{.host = {}, .port = {}, .path = {}, .tls = text.starts_with(kTls), .files = {}};
  std::string_view place = text.starts_with(kTcp) || address.tls ? text.substr(kTcp.size()) : text;
  if (const std::size_t mark = place.find('?'); address.tls && mark != std::string_view::npos) {
    address.files = files_in(text, place.substr(mark + 1));
    place = place.substr(0, mark);
  } else {
    address.spin = take_spin(text, place, kMaxSocketSpinUs).value_or(address.spin);
  }
  std::string_view host = place;
  std::string_view port = "7300";
  const std::size_t colon = place.rfind(':');
  if (colon != std::string_view::npos && place.find(']', colon) == std::string_view::npos) {
    host = place.substr(0, colon);
    port = place.substr(colon + 1);
  }
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  if (host.empty())
    bad_address(text, "expected tcp:HOST:PORT, HOST:PORT, tls:HOST:PORT, unix:PATH or shm:PATH");
  if (host.find('/') != std::string_view::npos) {
    bad_address(text, "a host has no '/'; a unix socket is written unix:PATH");
  }
  if (host.ends_with(".toml")) {
    bad_address(
        text, "a bench file is opened in this process as inproc:FILE, or served by `drivebench serve FILE`");
  }
  if (!is_port(port)) bad_address(text, "the port must be a number from 1 to 65535");
  address.host = host;
  address.port = port;
  return address;
}

std::string to_string(const Address& address) {
  if (!address.path.empty()) return (address.shares_memory ? "shm:" : "unix:") + address.path;
  const bool is_ipv6 = address.host.find(':') != std::string::npos;
  return (address.tls ? "tls:" : "tcp:") + (is_ipv6 ? "[" + address.host + "]" : address.host) + ":" +
         address.port;
}

FileDescriptor connect_to(const Address& address, std::chrono::milliseconds deadline) {
  if (!address.path.empty()) return connect_unix(address, deadline);
  FileDescriptor socket = connect_tcp(address, deadline);
  if (!address.tls) return socket;
  return tunnel_through_tls(std::move(socket), address.host, address.files, deadline);
}

}  // namespace drivebench::link
