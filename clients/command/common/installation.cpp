#include "clients/command/common/installation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <system_error>
#include <vector>

#include "clients/command/common/errors.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace fs = std::filesystem;

fs::path own_executable() {
  return fs::read_symlink("/proc/self/exe");
}

fs::path server_executable() {
  fs::path server = own_executable().parent_path() / "drivebench-server";
  if (!fs::exists(server)) throw UsageError("there is no " + server.string());
  return server;
}

namespace {

/// Adds the names of the TOML files in a folder, if it is there.
void add_names(const fs::path& folder, std::vector<std::string>& names) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
}

/// A TOML file by its path, or else by its name in this folder of any `configs`.
fs::path find_in(std::string_view folder_of_configs, std::string_view what, std::string_view choice) {
  std::error_code ignored;
  if (fs::is_regular_file(choice, ignored)) return choice;

  std::vector<fs::path> folders;
  if (const char* chosen = std::getenv("DRIVEBENCH_CONFIGS"); chosen != nullptr) folders.emplace_back(chosen);
  folders.emplace_back("configs");
  // build/release/bin and an installation's bin are at most three folders below the one with configs.
  fs::path above = own_executable().parent_path();
  for (int i = 0; i < 4; ++i, above = above.parent_path())
    folders.push_back(above / "configs");

  std::vector<std::string> looked_at = {printable(choice)};
  std::vector<std::string> there;
  fs::path file(choice);
  if (file.extension() != ".toml") file += ".toml";
  for (const fs::path& folder : folders) {
    fs::path found = folder / folder_of_configs / file;
    if (fs::is_regular_file(found, ignored)) return found;
    if (std::ranges::find(looked_at, found.string()) == looked_at.end()) looked_at.push_back(found.string());
    add_names(folder / folder_of_configs, there);
  }
  throw UsageError(fmt::format("no {} '{}'{}; looked for\n  {}", what, printable(choice),
                               did_you_mean(fs::path(choice).stem().string(), there),
                               fmt::join(looked_at, "\n  ")));
}

}  // namespace

fs::path find_config(std::string_view choice) {
  return find_in("benches", "bench file", choice);
}

fs::path find_experiment_file(std::string_view choice) {
  return find_in("experiments", "experiment file", choice);
}

fs::path find_motor_file(std::string_view choice) {
  return find_in("motors", "motor file", choice);
}

}  // namespace drivebench::command
