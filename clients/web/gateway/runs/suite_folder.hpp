#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench::web {

/// The suites in a folder, as they stand there when they are asked for: folders with a .toml file in them, at
/// any depth, whose names are those of reports without an ending. Links are none of them.
class SuiteFolder {
 public:
  /// Throws StartError if it is no folder.
  explicit SuiteFolder(const std::filesystem::path& folder);

  /// At most 200 names, sorted.
  std::vector<std::string> names() const;
  /// The folder of a suite; empty: there is none of this name.
  std::filesystem::path find(std::string_view name) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace drivebench::web
