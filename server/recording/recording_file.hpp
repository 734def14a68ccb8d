#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <span>

namespace drivebench {

/// What the recorder asks of a file. Each call is the system call of its name, errno included; tests put
/// disks in its place that fill, fail, stall or forget.
class RecordingFile {
 public:
  virtual ~RecordingFile() = default;  ///< closes it, whatever that says
  virtual ssize_t write(std::span<const std::byte> bytes) noexcept = 0;
  virtual int truncate(std::uint64_t size) noexcept = 0;
  /// What was written is on the disk (fdatasync).
  virtual int sync() noexcept = 0;
  virtual int close() noexcept = 0;
  /// What is free on its disk, in bytes.
  virtual std::uint64_t free_bytes() noexcept { return std::numeric_limits<std::uint64_t>::max(); }
};

using CreateRecordingFile = std::function<std::unique_ptr<RecordingFile>(const std::filesystem::path&)>;

/// A new file of the system, whose name is on the disk when this returns; throws std::system_error if it
/// exists or cannot be made.
std::unique_ptr<RecordingFile> create_recording_file(const std::filesystem::path& path);

/// A file whose folder is not synced may be gone after a power cut, however often it was synced itself.
void sync_folder_of(const std::filesystem::path& path) noexcept;

}  // namespace drivebench
