#include "clients/command/common/installation.hpp"

#include <cstdlib>
#include <vector>

#include "clients/command/common/errors.hpp"

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

  std::string looked_at;
  fs::path file(choice);
  if (file.extension() != ".toml") file += ".toml";
  for (const fs::path& folder : folders) {
    fs::path found = folder / folder_of_configs / file;
    if (fs::is_regular_file(found, ignored)) return found;
    looked_at += "\n  " + found.string();
  }
  throw UsageError("no " + std::string(what) + " '" + std::string(choice) + "'; looked for\n  " +
                   std::string(choice) + looked_at);
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
