#include "clients/web/gateway/reports/report_folder.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "clients/link/common/file_descriptor.hpp"
#include "clients/web/gateway/doors/listen_address.hpp"
#include "protocols/json.hpp"

namespace drivebench::web {
namespace {

constexpr std::size_t kMostListed = 500;
constexpr std::size_t kMostSeen = 10'000;  // entries of a folder that are looked at
constexpr std::size_t kLongestName = 200;

bool is_of_names(char c) noexcept {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
         c == '-' || c == '+';
}

/// The Content-Type of a report by its name; empty: the name is none of a report.
std::string_view type_of_report(std::string_view name) noexcept {
  if (!is_report_name(name)) return {};
  for (const auto& [extension, type] : kReportTypes) {
    if (name.size() > extension.size() && name.ends_with(extension)) return type;
  }
  return {};
}

link::FileDescriptor open_folder(const std::filesystem::path& folder) {
  return link::FileDescriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
}

/// The first bytes of a file, at most so many.
std::string read_at_most(int file, std::size_t most) {
  std::string bytes(most, '\0');
  std::size_t size = 0;
  while (size < most) {
    const ssize_t got = ::read(file, bytes.data() + size, most - size);
    if (got <= 0) break;
    size += static_cast<std::size_t>(got);
  }
  bytes.resize(size);
  return bytes;
}

struct Entry {
  std::string name;
  std::int64_t modified_s = 0;
  std::int64_t bytes = 0;
};

std::vector<Entry> entries_of(const std::filesystem::path& path) {
  std::vector<Entry> entries;
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir(path.c_str()), &::closedir);
  if (!folder) return entries;
  std::size_t seen = 0;
  for (const dirent* each = ::readdir(folder.get()); each != nullptr && seen < kMostSeen;
       each = ::readdir(folder.get()), ++seen) {
    const std::string_view name = static_cast<const char*>(each->d_name);
    if (type_of_report(name).empty()) continue;
    struct stat facts {};
    const int got = ::fstatat(::dirfd(folder.get()), each->d_name, &facts, AT_SYMLINK_NOFOLLOW);
    if (got != 0 || !S_ISREG(facts.st_mode)) continue;
    entries.push_back(
        {.name = std::string(name), .modified_s = facts.st_mtim.tv_sec, .bytes = facts.st_size});
  }
  return entries;
}

}  // namespace

bool is_report_name(std::string_view name) noexcept {
  return !name.empty() && name.size() <= kLongestName && !name.starts_with('.') &&
         std::ranges::all_of(name, is_of_names);
}

ReportFolder::ReportFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
  if (!open_folder(folder_).is_open())
    throw StartError("--reports " + folder_.string() + ": no folder to read");
}

std::string ReportFolder::list() const {
  std::vector<Entry> entries = entries_of(folder_);
  std::ranges::sort(entries, [](const Entry& a, const Entry& b) {
    return a.modified_s != b.modified_s ? a.modified_s > b.modified_s : a.name < b.name;
  });
  if (entries.size() > kMostListed) entries.resize(kMostListed);
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Entry& each : entries)
    list.push_back({{"name", each.name},
                    {"modified_s", each.modified_s},
                    {"bytes", each.bytes},
                    {"is_too_large", std::cmp_greater(each.bytes, kMostBytes)}});
  return json_text(list);
}

std::optional<ReportFile> ReportFolder::find(std::string_view name) const {
  const std::string_view type = type_of_report(name);
  if (type.empty()) return std::nullopt;
  const link::FileDescriptor folder = open_folder(folder_);
  if (!folder.is_open()) return std::nullopt;
  // A pipe would wait for its writer, and a link may lead out of the folder.
  const link::FileDescriptor file(
      ::openat(folder.get(), std::string(name).c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat facts {};
  if (!file.is_open() || ::fstat(file.get(), &facts) != 0 || !S_ISREG(facts.st_mode)) return std::nullopt;
  if (std::cmp_greater(facts.st_size, kMostBytes)) return ReportFile{.is_too_large = true};
  return ReportFile{.bytes = read_at_most(file.get(), static_cast<std::size_t>(facts.st_size)), .type = type};
}

}  // namespace drivebench::web
