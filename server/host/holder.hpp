#pragma once

#include <cstdint>
#include <string>

/// Who already has what this program wants, as far as /proc lets it see: " (process 123, drivebench-server)",
/// or nothing.
namespace drivebench {

/// Of a TCP port on which somebody listens.
std::string holder_of_port(std::uint16_t port);
/// Of a file that somebody has open.
std::string holder_of_file(const std::string& path);

}  // namespace drivebench
