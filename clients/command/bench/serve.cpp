#include "clients/command/bench/serve.hpp"

#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"

namespace drivebench::command {

int run_serve(const std::vector<std::string>& arguments) {
  const bool names_config = !arguments.empty() && !arguments.front().starts_with('-');
  std::vector<std::string> server = {server_executable().string(),
                                     find_config(names_config ? arguments.front() : "servo").string()};
  server.insert(server.end(), arguments.begin() + (names_config ? 1 : 0), arguments.end());
  replace_process(server);
}

int run_print(const PrintOptions& options) {
  std::vector<std::string> server = {server_executable().string(), find_config(options.config).string(),
                                     "--print", options.what};
  if (options.what == "dbc" || options.what == "can-table") {
    server.insert(server.end(), {"--bus", std::to_string(options.bus)});
  }
  replace_process(server);
}

}  // namespace drivebench::command
