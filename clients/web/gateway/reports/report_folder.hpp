#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace drivebench::web {

/// The endings of reports with their Content-Type.
inline constexpr auto kReportTypes = std::to_array<std::pair<std::string_view, std::string_view>>({
    {".html", "text/html; charset=utf-8"},
    {".json", "application/json"},
    {".svg", "image/svg+xml"},
});

/// Whether the name is of letters, digits, `.`, `_`, `-` and `+` and does not begin with a dot.
bool is_report_name(std::string_view name) noexcept;

/// A report that a browser asked for.
struct ReportFile {
  std::string bytes{};
  std::string_view type{};  ///< Content-Type
  bool is_too_large = false;
};

/// The reports in a folder, as they stand there when they are asked for: regular files of the folder itself
/// whose names are of letters, digits, `.`, `_`, `-` and `+`, do not begin with a dot and end with .html,
/// .json or .svg. Links are none of them, wherever they lead.
class ReportFolder {
 public:
  static constexpr std::size_t kMostBytes = 8 * 1024 * 1024;  ///< of a report that is opened

  /// Throws StartError if it is no folder.
  explicit ReportFolder(std::filesystem::path folder);

  /// The 500 newest, newest first, as JSON: [{"name", "modified_s", "bytes", "is_too_large"}], with the UTC
  /// of the last change.
  std::string list() const;
  /// The report of this name, not decoded in any way; nothing: there is none.
  std::optional<ReportFile> find(std::string_view name) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace drivebench::web
