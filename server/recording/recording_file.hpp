#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>

namespace drivebench {

/// The change of a file by other programs while it was written.
struct FileFate {
  enum class Kind { kKept, kMoved, kRemoved, kChanged };
  Kind kind = Kind::kKept;
  std::string path{};  ///< of a moved file; empty: unknown
};

/// The file operations of the recorder. Each is the system call of its name and sets errno; tests use disks
/// that fill, fail, stall or forget.
class RecordingFile {
 public:
  virtual ~RecordingFile() = default;  ///< closes the file and ignores errors
  virtual ssize_t write(std::span<const std::byte> bytes) noexcept = 0;
  virtual int truncate(std::uint64_t size) noexcept = 0;
  /// Brings the written bytes to the disk (fdatasync).
  virtual int sync() noexcept = 0;
  virtual int close() noexcept = 0;
  /// Free space on the disk [bytes].
  virtual std::uint64_t free_bytes() noexcept { return std::numeric_limits<std::uint64_t>::max(); }
  /// Whether the file still has this name and this size; without a name only the size counts.
  virtual FileFate fate(const std::string& /*path*/, std::uint64_t /*size*/) { return {}; }
};

using CreateRecordingFile = std::function<std::unique_ptr<RecordingFile>(const std::filesystem::path&)>;

/// Creates a file that only the server's user can read and brings its name to the disk; throws
/// std::system_error if the file exists or cannot be created.
std::unique_ptr<RecordingFile> create_recording_file(const std::filesystem::path& path);

/// Syncs the folder of a file: without it a power cut can delete the file, even a synced one.
void sync_folder_of(const std::filesystem::path& path) noexcept;

}  // namespace drivebench
