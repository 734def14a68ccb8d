#include "clients/command/recording/replay.hpp"

#include <vector>

#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/process.hpp"

namespace drivebench::command {

int run_replay(const ReplayOptions& options) {
  std::vector<std::string> server = {server_executable().string(), "--replay", options.recording};
  if (options.json) server.emplace_back("--json");
  replace_process(server);
}

}  // namespace drivebench::command
