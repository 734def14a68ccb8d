#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace drivebench::command {

/// The file of this program.
std::filesystem::path own_executable();

/// drivebench-server, which stands next to this program. Throws UsageError when it does not.
std::filesystem::path server_executable();

/// A bench file by its path or name, see installation::find_file(). Throws UsageError with all places of the
/// search.
std::filesystem::path find_config(std::string_view choice);
/// An experiment file, searched for like a bench file, in `experiments/` of these folders.
std::filesystem::path find_experiment_file(std::string_view choice);
/// A folder of regression cases or a single case file, by its path, or the name of a folder in `suites/` of
/// these folders.
std::filesystem::path find_suite(std::string_view choice);
/// A motor file, searched for like a bench file, in `motors/` of these folders.
std::filesystem::path find_motor_file(std::string_view choice);

/// The folder with the page of `drivebench web`. Throws UsageError when it was not built.
std::filesystem::path find_page();

}  // namespace drivebench::command
