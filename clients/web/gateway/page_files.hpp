#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace drivebench::web {

struct PageFile {
  std::string bytes;
  std::string_view type;  ///< Content-Type
};

/// The files of the page by their paths, "/" for index.html. They are read once: no request reaches the file
/// system.
using PageFiles = std::map<std::string, PageFile, std::less<>>;

/// Throws StartError if a file cannot be read or is of an unknown type.
PageFiles read_page_files(const std::filesystem::path& folder);

}  // namespace drivebench::web
