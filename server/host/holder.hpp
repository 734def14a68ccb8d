#pragma once

#include <cstdint>
#include <string>

/// The process that holds a port or file, from /proc: " (process 123, drivebench-server)"; empty if it is
/// unknown.
namespace drivebench {

/// The process that listens on a TCP port.
std::string holder_of_port(std::uint16_t port);
/// A process that has a file open.
std::string holder_of_file(const std::string& path);

}  // namespace drivebench
