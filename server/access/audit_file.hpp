#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace drivebench {

/// A file to which lines are appended, each in one write, so that several programs and a rotation may share
/// it.
class AuditFile {
 public:
  /// Opens the file, or creates it for its owner only. Throws std::runtime_error if it is a link, not a
  /// regular file, or a file that other users may read or write.
  explicit AuditFile(std::filesystem::path path);
  ~AuditFile();
  AuditFile(const AuditFile&) = delete;
  AuditFile& operator=(const AuditFile&) = delete;

  /// Appends a line; false if the system did not take all of it, with errno saying why. The next line
  /// then begins on a line of its own.
  bool append(std::string line) noexcept;
  /// Opens the path anew, after a rotation. If that fails, returns false and keeps the old file.
  bool reopen() noexcept;

 private:
  std::filesystem::path path_;
  int file_ = -1;
  bool torn_ = false;  ///< the file ends within a line
};

}  // namespace drivebench
