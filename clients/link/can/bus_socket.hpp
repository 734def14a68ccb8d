#pragma once

#include <sys/socket.h>
#include <sys/time.h>
#include <sys/types.h>

#include <cerrno>
#include <chrono>
#include <cstddef>
#include <string>
#include <system_error>

#include "clients/link/can/can_bus.hpp"
#include "clients/link/common/address.hpp"
#include "clients/link/common/file_descriptor.hpp"

/// The common parts of the buses that are sockets of whole frames.
namespace drivebench::link {

/// The reason why the last system call failed.
inline std::string reason() {
  return std::generic_category().message(errno);
}

/// The kernel wakes recv() every 5 ms to look at the deadline: one call a frame instead of poll() and recv().
inline void set_patience(const FileDescriptor& fd) {
  const timeval limit = {.tv_sec = 0, .tv_usec = 5000};
  ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
}

template <class T>
void set_option(const FileDescriptor& fd, int level, int name, const T& value) {
  if (::setsockopt(fd.get(), level, name, &value, sizeof value) != 0) throw ConnectError(reason());
}

/// The size of a datagram that comes before the deadline; 0 if none comes. `receive` calls recv() with the
/// flags and returns its result.
template <class Receive>
std::size_t receive_datagram(const std::string& name, CanBus::Clock::time_point until, Receive receive) {
  using Clock = CanBus::Clock;
  for (;;) {
    const bool at_once = until <= Clock::time_point::min() || until <= Clock::now();
    const ssize_t got = receive(at_once ? MSG_DONTWAIT : 0);
    if (got > 0) return static_cast<std::size_t>(got);
    if (got < 0 && errno == EINTR) return 0;
    if (got < 0 && errno != EAGAIN) throw LinkError(name + " failed: " + reason());
    if (got < 0 && at_once) return 0;
  }
}

}  // namespace drivebench::link
