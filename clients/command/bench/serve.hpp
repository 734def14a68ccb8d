#pragma once

#include <string>
#include <vector>

/// Verbs of drivebench-server, which replaces this process.
namespace drivebench::command {

int run_serve(const std::vector<std::string>& arguments);

/// A description that drivebench-server prints of a bench file.
struct PrintOptions {
  std::string config = "servo";  ///< path or name
  std::string what{};            ///< "dbc", "can-table", "modbus-map" or "modbus-csv"
  unsigned bus = 1;              ///< number of one of its [[can]] sections
};
int run_print(const PrintOptions& options);

}  // namespace drivebench::command
