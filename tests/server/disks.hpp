#pragma once

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/recording_file.hpp"

/// Disks for the recorder that live in memory, keep a log of what was asked of them, and fail as they are
/// told.
namespace drivebench {

enum class DiskCall { kWrite, kTruncate, kSync, kClose };

struct DiskEntry {
  DiskCall call = DiskCall::kWrite;
  std::uint64_t at = 0;  ///< where a write went, or what size a truncate left
  std::vector<std::byte> bytes{};
};

/// What happened to one file, in order.
struct DiskLog {
  std::vector<DiskEntry> entries;
  std::vector<std::byte> content;  ///< as a reader sees it while the machine lives
};

/// The disk of a test. Calls come from one thread, the recorder's; look at it when the recorder is gone.
class MemoryDisk {
 public:
  /// Gets the number of the call of its kind on this disk, from 1 on; the errno with which it fails, 0 for
  /// none.
  using Fault = std::function<int(DiskCall, std::size_t)>;

  CreateRecordingFile creator(Fault fault = {}) {
    fault_ = std::move(fault);
    return [this](const std::filesystem::path& path) -> std::unique_ptr<RecordingFile> {
      names.push_back(path.filename().string());
      return std::make_unique<File>(*this, files[names.back()]);
    };
  }

  std::map<std::string, DiskLog> files;
  std::vector<std::string> names;  ///< in the order in which they were made

 private:
  class File final : public RecordingFile {
   public:
    File(MemoryDisk& disk, DiskLog& log) : disk_(disk), log_(log) {}
    ssize_t write(std::span<const std::byte> bytes) noexcept override {
      if (disk_.fails(DiskCall::kWrite)) return -1;
      log_.entries.push_back({DiskCall::kWrite, log_.content.size(), {bytes.begin(), bytes.end()}});
      log_.content.insert(log_.content.end(), bytes.begin(), bytes.end());
      return static_cast<ssize_t>(bytes.size());
    }
    int truncate(std::uint64_t size) noexcept override {
      log_.entries.push_back({DiskCall::kTruncate, size, {}});
      log_.content.resize(size);
      return 0;
    }
    int sync() noexcept override { return simple(DiskCall::kSync); }
    int close() noexcept override { return simple(DiskCall::kClose); }

   private:
    int simple(DiskCall call) noexcept {
      if (disk_.fails(call)) return -1;
      log_.entries.push_back({call, 0, {}});
      return 0;
    }
    MemoryDisk& disk_;
    DiskLog& log_;
  };

  bool fails(DiskCall call) noexcept {
    const std::size_t number = ++calls_[call];
    const int error = fault_ ? fault_(call, number) : 0;
    if (error != 0) errno = error;
    return error != 0;
  }

  Fault fault_;
  std::map<DiskCall, std::size_t> calls_;
};

}  // namespace drivebench
