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

/// Writes all bytes, in as many calls as the system needs; false, with errno, on an error.
bool write_all(int descriptor, std::span<const std::byte> bytes) noexcept;

/// Writes the data of an experiment: rows of little-endian float64, one for each signal. One thread appends;
/// other threads may read the rows that published() counts.
class RowWriter {
 public:
  /// Throws std::system_error if the file exists or cannot be created.
  RowWriter(const std::filesystem::path& file, std::vector<const Signal*> signals,
            std::atomic<std::uint64_t>& published);
  ~RowWriter();
  RowWriter(const RowWriter&) = delete;
  RowWriter& operator=(const RowWriter&) = delete;

  /// False on a disk error; the published rows stay valid.
  bool append(const Sample& sample) noexcept;
  /// Publishes all rows so far.
  bool flush() noexcept;
  /// Publishes all rows and brings them to the disk.
  bool finish() noexcept;

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{1} << 16;

  std::vector<const Signal*> signals_;
  std::atomic<std::uint64_t>& published_;
  std::vector<double> buffer_;
  std::size_t capacity_;
  int descriptor_;
};

/// Reads a file by position while another thread appends to it.
class FileReader {
 public:
  /// Throws std::system_error if it cannot be opened.
  explicit FileReader(const std::filesystem::path& file);
  ~FileReader();
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;

  /// Fills `out` from byte `from` on; throws std::system_error if the file is too short.
  void read(std::uint64_t from, std::span<std::byte> out) const;

 private:
  int descriptor_;
};

}  // namespace drivebench
