#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

/// ZIP files.
namespace drivebench::archive {

struct Entry {
  std::string name;  ///< with folders: "binaries/linux64/servo.so"
  std::string bytes;
};

class ZipError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Writes a ZIP file in the place of the one that is there. The same entries give the same bytes: their order
/// is kept, and each has the first date that the format knows. Throws ZipError; the old file then is still
/// there.
void write_zip(const std::filesystem::path& file, const std::vector<Entry>& entries);

}  // namespace drivebench::archive
