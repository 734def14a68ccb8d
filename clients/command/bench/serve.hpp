#pragma once

#include <string>
#include <vector>

/// What drivebench-server does by itself. Both replace this process by it.
namespace drivebench::command {

int run_serve(const std::vector<std::string>& arguments);

/// What drivebench-server can print of a bench file.
struct PrintOptions {
  std::string config = "servo";  ///< path or name
  std::string what{};            ///< "dbc", "can-table", "modbus-map" or "modbus-csv"
  unsigned bus = 1;              ///< which of its [[can]] sections
};
int run_print(const PrintOptions& options);

}  // namespace drivebench::command
