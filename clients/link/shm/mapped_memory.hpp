#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::link {

/// Memory that a bench shares with this program, mapped.
class MappedMemory {
 public:
  /// Throws LinkError if another program could make it shorter, or if it is shorter than its head.
  MappedMemory(const FileDescriptor& memory, std::size_t head_bytes, const std::string& peer);
  ~MappedMemory();
  MappedMemory(const MappedMemory&) = delete;
  MappedMemory& operator=(const MappedMemory&) = delete;

  std::size_t bytes() const noexcept { return bytes_; }
  void* address() const noexcept { return address_; }

 private:
  std::size_t bytes_;
  void* address_ = nullptr;
};

/// Throws LinkError about memory that the peer has shared.
[[noreturn]] void refuse_memory(const std::string& peer, std::string_view what);

}  // namespace drivebench::link
