#include "clients/web/gateway/runs/suite_folder.hpp"

#include <algorithm>
#include <system_error>

#include "clients/web/gateway/doors/listen_address.hpp"
#include "clients/web/gateway/reports/report_folder.hpp"

namespace drivebench::web {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostSuites = 200;
constexpr std::size_t kMostLookedAt = 10'000;  // entries of a folder

/// Calls `is_enough` with the entries until it says so. What cannot be read has none.
template <class Iterator, class Enough>
void visit(const fs::path& folder, Enough is_enough) {
  std::error_code error;
  std::size_t seen = 0;
  for (Iterator each(folder, error), end; !error && each != end && seen < kMostLookedAt; ++seen) {
    if (is_enough(*each)) return;
    each.increment(error);
  }
}

bool is_suite(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(folder, error))) return false;
  bool has_case = false;
  visit<fs::recursive_directory_iterator>(folder, [&has_case](const fs::directory_entry& entry) {
    std::error_code ignored;
    has_case = entry.path().extension() == ".toml" && entry.is_regular_file(ignored);
    return has_case;
  });
  return has_case;
}

}  // namespace

SuiteFolder::SuiteFolder(const fs::path& folder) {
  std::error_code error;
  folder_ = fs::canonical(folder, error);
  if (error || !fs::is_directory(folder_, error))
    throw StartError("--suites " + folder.string() + ": no folder to read");
}

std::vector<std::string> SuiteFolder::names() const {
  std::vector<std::string> names;
  visit<fs::directory_iterator>(folder_, [&names](const fs::directory_entry& entry) {
    std::string name = entry.path().filename().string();
    if (is_report_name(name) && is_suite(entry.path())) names.push_back(std::move(name));
    return names.size() >= kMostSuites;
  });
  std::ranges::sort(names);
  return names;
}

fs::path SuiteFolder::find(std::string_view name) const {
  if (!is_report_name(name)) return {};
  fs::path folder = folder_ / name;
  return is_suite(folder) ? folder : fs::path();
}

}  // namespace drivebench::web
