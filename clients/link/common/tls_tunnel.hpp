#pragma once

#include <chrono>
#include <string>

#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::link {

/// Files in PEM. Without `ca` those certificates are trusted that the system trusts.
struct TlsFiles {
  std::string ca;           ///< certificates of the authorities that may sign the server's
  std::string certificate;  ///< our own, for a server that asks for one; empty: none
  std::string key;          ///< of our certificate
};

/// Speaks TLS 1.3 over a connected socket to `host`, whose certificate must be its own, and gives a plain
/// stream socket for it. A thread carries the bytes until one of the ends is closed. Throws ConnectError.
FileDescriptor tunnel_through_tls(FileDescriptor socket, const std::string& host, const TlsFiles& files,
                                  std::chrono::milliseconds deadline);

}  // namespace drivebench::link
