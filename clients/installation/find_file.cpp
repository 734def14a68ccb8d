#include "clients/installation/find_file.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <system_error>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::installation {
namespace fs = std::filesystem;
namespace {

/// Adds the names of the TOML files in a folder, if it is there.
void add_names(const fs::path& folder, std::vector<std::string>& names) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
}

/// Adds the names of the folders in a folder, if it is there.
void add_folders(const fs::path& folder, std::vector<std::string>& names) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.is_directory(ignored)) names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
}

}  // namespace

fs::path own_file() {
  Dl_info place{};
  std::error_code ignored;
  // The loader knows a library by its path, but a program only by the name that it was started with.
  if (::dladdr(reinterpret_cast<const void*>(&own_file), &place) != 0) {
    const std::string name = fs::path(place.dli_fname).filename().string();
    if (name.starts_with("lib") && name.find(".so") != std::string::npos) {
      return fs::weakly_canonical(place.dli_fname, ignored);
    }
  }
  return fs::read_symlink("/proc/self/exe", ignored);
}

namespace {

/// `configs` and `share/drivebench` in the folders above own_file(): build/release/bin stands three folders
/// below the one with configs; an installation has bin/ or lib/ARCHITECTURE/ beside share/.
std::vector<fs::path> folders_above() {
  std::vector<fs::path> folders;
  fs::path above = own_file().parent_path();
  for (int i = 0; i < 4; ++i, above = above.parent_path()) {
    folders.push_back(above / "configs");
    folders.push_back(above / "share" / "drivebench");
  }
  folders.emplace_back(DRIVEBENCH_DATA_FOLDER);  // for a program elsewhere that holds the static library
  return folders;
}

/// Where files that come with drivebench may stand.
std::vector<fs::path> folders_to_search() {
  std::vector<fs::path> folders;
  if (const char* chosen = std::getenv("DRIVEBENCH_CONFIGS"); chosen != nullptr) folders.emplace_back(chosen);
  folders.emplace_back("configs");
  std::ranges::copy(folders_above(), std::back_inserter(folders));
  return folders;
}

/// The first `folder / kind / name` that `is_right`; `add` collects the names that there are.
template <class IsRight, class Add>
fs::path search(std::string_view kind, std::string_view what, std::string_view choice, const fs::path& name,
                IsRight is_right, Add add) {
  std::vector<std::string> looked_at = {printable(choice)};
  std::vector<std::string> there;
  for (const fs::path& folder : folders_to_search()) {
    fs::path found = folder / kind / name;
    if (is_right(found)) return found;
    if (std::ranges::find(looked_at, found.string()) == looked_at.end()) looked_at.push_back(found.string());
    add(folder / kind, there);
  }
  std::string places;
  for (const std::string& place : looked_at)
    places += "\n  " + place;
  throw NotFound("no " + std::string(what) + " '" + printable(choice) + "'" +
                 did_you_mean(fs::path(choice).stem().string(), there) + "; looked for" + places);
}

template <class Add>
std::vector<std::string> names_in(std::string_view kind, Add add) {
  std::vector<std::string> names;
  for (const fs::path& folder : folders_to_search())
    add(folder / kind, names);
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

bool is_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

}  // namespace

fs::path find_file(std::string_view kind, std::string_view what, std::string_view choice) {
  if (is_file(choice)) return choice;
  fs::path file(choice);
  if (file.extension() != ".toml") file += ".toml";
  return search(kind, what, choice, file, is_file, add_names);
}

fs::path find_folder(std::string_view kind, std::string_view what, std::string_view choice) {
  if (is_folder(choice) || is_file(choice)) return choice;
  return search(kind, what, choice, choice, is_folder, add_folders);
}

std::vector<std::string> file_names(std::string_view kind) {
  return names_in(kind, add_names);
}

std::vector<std::string> folder_names(std::string_view kind) {
  return names_in(kind, add_folders);
}

fs::path find_page() {
  std::error_code ignored;
  for (const fs::path& folder : folders_above()) {
    if (fs::is_regular_file(folder / "web" / "index.html", ignored)) return folder / "web";
  }
  throw NotFound(
      "the page was not built: it needs node and npm when drivebench is built (Debian: apt install nodejs "
      "npm)");
}

}  // namespace drivebench::installation
