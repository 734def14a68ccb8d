#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "protocols/signals/catalogue.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench {

/// All of it, however the system cuts it up; false, with errno, when the disk takes no more.
bool write_all(int descriptor, std::span<const std::byte> bytes) noexcept;

/// The data of an experiment: rows of little-endian float64, one for each signal. One thread appends; others
/// read what published() says.
class RowWriter {
 public:
  /// Throws std::system_error if the file exists or cannot be made.
  RowWriter(const std::filesystem::path& file, std::vector<const Signal*> signals,
            std::atomic<std::uint64_t>& published);
  ~RowWriter();
  RowWriter(const RowWriter&) = delete;
  RowWriter& operator=(const RowWriter&) = delete;

  /// False when the disk takes no more; what was published before stays good.
  bool append(const Sample& sample) noexcept;
  /// Publishes all rows so far.
  bool flush() noexcept;
  /// The same, and whatever happens to the power, they are there.
  bool finish() noexcept;

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{1} << 16;

  std::vector<const Signal*> signals_;
  std::atomic<std::uint64_t>& published_;
  std::vector<double> buffer_;
  std::size_t capacity_;
  int descriptor_;
};

/// A file that others write, read by position.
class FileReader {
 public:
  /// Throws std::system_error if it cannot be opened.
  explicit FileReader(const std::filesystem::path& file);
  ~FileReader();
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;

  /// Fills `out` from this byte on; throws std::system_error if the file ends before.
  void read(std::uint64_t from, std::span<std::byte> out) const;

 private:
  int descriptor_;
};

}  // namespace drivebench
