#include "clients/command/common/programs/installation.hpp"

#include "clients/command/common/basics/errors.hpp"
#include "clients/installation/find_file.hpp"

namespace drivebench::command {
namespace fs = std::filesystem;
namespace {

fs::path find_or_refuse(std::string_view kind, std::string_view what, std::string_view choice) {
  try {
    return installation::find_file(kind, what, choice);
  } catch (const installation::NotFound& not_found) {
    throw UsageError(not_found.what());
  }
}

}  // namespace

fs::path own_executable() {
  return fs::read_symlink("/proc/self/exe");
}

fs::path server_executable() {
  fs::path server = own_executable().parent_path() / "drivebench-server";
  if (!fs::exists(server))
    throw UsageError("there is no " + server.string() + " (package drivebench-server)");
  return server;
}

fs::path find_config(std::string_view choice) {
  return find_or_refuse("benches", "bench file", choice);
}

fs::path find_experiment_file(std::string_view choice) {
  return find_or_refuse("experiments", "experiment file", choice);
}

fs::path find_suite(std::string_view choice) {
  try {
    return installation::find_folder("suites", "suite", choice);
  } catch (const installation::NotFound& not_found) {
    throw UsageError(not_found.what());
  }
}

fs::path find_motor_file(std::string_view choice) {
  return find_or_refuse("motors", "motor file", choice);
}

fs::path find_page() {
  try {
    return installation::find_page();
  } catch (const installation::NotFound& not_found) {
    throw UsageError(not_found.what());
  }
}

}  // namespace drivebench::command
