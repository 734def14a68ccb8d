#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// The files that come with drivebench.
namespace drivebench::installation {

/// There is no such file; what() names all places of the search.
class NotFound : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The file of the program or shared library that holds this code.
std::filesystem::path own_file();

/// A TOML file: `choice` as a path, or else by its name ("servo" or "servo.toml") in `kind` ("benches",
/// "motors", "experiments") of the folder DRIVEBENCH_CONFIGS, of `configs` here, or of `configs` or
/// `share/drivebench` in a folder above own_file(). `what` names such a file in the sentence of NotFound.
std::filesystem::path find_file(std::string_view kind, std::string_view what, std::string_view choice);

/// A folder, or a single TOML file: `choice` as a path, or else a folder by its name in `kind` ("suites") of
/// the same folders.
std::filesystem::path find_folder(std::string_view kind, std::string_view what, std::string_view choice);

/// The names that find_file() and find_folder() know in `kind`, in their order.
std::vector<std::string> file_names(std::string_view kind);
std::vector<std::string> folder_names(std::string_view kind);

/// The folder with the page of `drivebench web`: `web` in `share/drivebench` in a folder above own_file().
std::filesystem::path find_page();

}  // namespace drivebench::installation
