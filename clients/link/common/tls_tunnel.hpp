#pragma once

#include <chrono>
#include <string>

#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::link {

/// Files in PEM. Without `ca` the system's certificates are trusted.
struct TlsFiles {
  std::string ca;           ///< certificates of the authorities that may sign the server's
  std::string certificate;  ///< the client's certificate, if the server needs one; empty: none
  std::string key;          ///< of the client's certificate
};

/// Speaks TLS 1.3 over a connected socket to `host`, whose certificate must bear that name, and returns a
/// plain stream socket. A thread carries the bytes until one end is closed. Throws ConnectError.
FileDescriptor tunnel_through_tls(FileDescriptor socket, const std::string& host, const TlsFiles& files,
                                  std::chrono::milliseconds deadline);

}  // namespace drivebench::link
