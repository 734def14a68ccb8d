#pragma once

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/recording/recording_file.hpp"

/// Disks for the recorder that live in memory, log every call, and fail on request.
namespace drivebench {

enum class DiskCall { kWrite, kTruncate, kSync, kClose };

struct DiskEntry {
  DiskCall call = DiskCall::kWrite;
  std::uint64_t at = 0;  ///< place of a write, or size after a truncate
  std::vector<std::byte> bytes{};
};

/// The calls for one file, in order.
struct DiskLog {
  std::vector<DiskEntry> entries;
  std::vector<std::byte> content;  ///< as a reader sees it while the machine lives
};

/// The disk of a test. The recorder's thread alone calls it; read it when the recorder is gone.
class MemoryDisk {
 public:
  /// Returns the errno with which a call fails, 0 for none; its argument is the number of the call of its
  /// kind on this disk, from 1 on.
  using Fault = std::function<int(DiskCall, std::size_t)>;

  CreateRecordingFile creator(Fault fault = {}) {
    fault_ = std::move(fault);
    return [this](const std::filesystem::path& path) -> std::unique_ptr<RecordingFile> {
      names.push_back(path.filename().string());
      return std::make_unique<File>(*this, files[names.back()]);
    };
  }

  std::uint64_t free_bytes = std::numeric_limits<std::uint64_t>::max();
  std::map<std::string, DiskLog> files;
  std::vector<std::string> names;  ///< in the order in which they were made

 private:
  class File final : public RecordingFile {
   public:
    File(MemoryDisk& disk, DiskLog& log) : disk_(disk), log_(log) {}
    ssize_t write(std::span<const std::byte> bytes) noexcept override {
      if (disk_.fails(DiskCall::kWrite)) return -1;
      if (bytes.size() > disk_.free_bytes) {
        errno = ENOSPC;
        return -1;
      }
      disk_.free_bytes -= bytes.size();
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
    std::uint64_t free_bytes() noexcept override { return disk_.free_bytes; }

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

/// A disk that can be made to stand still.
class StallingDisk {
 public:
  CreateRecordingFile creator() {
    return [this](const std::filesystem::path& path) -> std::unique_ptr<RecordingFile> {
      return std::make_unique<File>(*this, create_recording_file(path));
    };
  }
  void stall(bool on) {
    const std::lock_guard lock(mutex_);
    stalled_ = on;
    changed_.notify_all();
  }
  void wait_until_it_holds_a_writer() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return waiting_; });
  }

 private:
  class File final : public RecordingFile {
   public:
    File(StallingDisk& disk, std::unique_ptr<RecordingFile> file) : disk_(disk), file_(std::move(file)) {}
    ssize_t write(std::span<const std::byte> bytes) noexcept override {
      disk_.pass();
      return file_->write(bytes);
    }
    int truncate(std::uint64_t size) noexcept override { return file_->truncate(size); }
    int sync() noexcept override {
      disk_.pass();
      return file_->sync();
    }
    int close() noexcept override { return file_->close(); }

   private:
    StallingDisk& disk_;
    std::unique_ptr<RecordingFile> file_;
  };
  void pass() {
    std::unique_lock lock(mutex_);
    waiting_ = stalled_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !stalled_; });
    waiting_ = false;
  }
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stalled_ = false;
  bool waiting_ = false;
};

}  // namespace drivebench
