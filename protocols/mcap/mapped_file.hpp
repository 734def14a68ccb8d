#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace drivebench {

/// A whole file, mapped for reading. No program may truncate the file while it is mapped.
class MappedFile {
 public:
  /// Throws std::system_error that names the path.
  explicit MappedFile(const std::string& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const std::byte> bytes() const noexcept { return {static_cast<const std::byte*>(start_), size_}; }

 private:
  void* start_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace drivebench
